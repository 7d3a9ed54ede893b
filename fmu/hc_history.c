/* Past values of continuous signals; see hc_history.h. */
#include "hc_history.h"

#include <stdlib.h>
#include <string.h>

#include "hc_numbers.h"

enum { NODES = 4 };

static const double *row_of(const hc_history *h, size_t i)
{
    return h->row + (h->first + i) * (size_t)(1 + h->n);
}

int hc_history_new(hc_history *h, int n)
{
    memset(h, 0, sizeof *h);
    h->n = n;
    if (n == 0)
        return 1;
    h->delay = calloc(2 * (size_t)n, sizeof *h->delay);
    h->before = h->delay ? h->delay + n : NULL;
    return h->delay != NULL;
}

void hc_history_free(hc_history *h)
{
    free(h->row);
    free(h->delay);
    memset(h, 0, sizeof *h);
}

void hc_history_clear(hc_history *h)
{
    h->first = h->rows = 0;
}

/* Room for one more row: the old rows move to the beginning, or the memory doubles. */
static int reserve(hc_history *h, size_t rows)
{
    const size_t width = (size_t)(1 + h->n);
    double *more;
    if (h->first + rows <= h->room)
        return 1;
    if (2 * rows <= h->room) {
        memmove(h->row, h->row + h->first * width, h->rows * width * sizeof *h->row);
        h->first = 0;
        return 1;
    }
    more = malloc((2 * rows + 64) * width * sizeof *more);
    if (!more)
        return 0;
    if (h->rows > 0)
        memcpy(more, h->row + h->first * width, h->rows * width * sizeof *more);
    free(h->row);
    h->row = more;
    h->first = 0;
    h->room = 2 * rows + 64;
    return 1;
}

int hc_history_keep(hc_history *h, double t, const double *value)
{
    const size_t width = (size_t)(1 + h->n);
    double longest = 0.0, *last;
    if (h->n == 0)
        return 1;
    if (h->rows > 0 && row_of(h, h->rows - 1)[0] >= t &&
        memcmp(row_of(h, h->rows - 1) + 1, value, (size_t)h->n * sizeof *value) == 0)
        return 1;
    if (h->rows > 1 && row_of(h, h->rows - 1)[0] >= t && row_of(h, h->rows - 2)[0] >= t)
        h->rows--; /* a third value at one time replaces the second */
    if (!reserve(h, h->rows + 1))
        return 0;
    last = h->row + (h->first + h->rows++) * width;
    last[0] = t;
    memcpy(last + 1, value, (size_t)h->n * sizeof *value);
    for (int k = 0; k < h->n; k++)
        longest = h->delay[k] > longest ? h->delay[k] : longest;
    while (h->rows > NODES && row_of(h, NODES - 1)[0] < t - longest) {
        h->first++;
        h->rows--;
    }
    return 1;
}

/* The time and value of node i, of which the last is (t, now). */
static void node(const hc_history *h, size_t i, int k, double t, double now, double *at, double *value)
{
    *at = i < h->rows ? row_of(h, i)[0] : t;
    *value = i < h->rows ? row_of(h, i)[1 + k] : now;
}

double hc_history_late(const hc_history *h, int k, double t, double now)
{
    const double from = t - h->delay[k];
    size_t low = 0, high = h->rows, n = h->rows;
    double at[NODES], value[NODES], sum = 0.0;
    if (h->delay[k] == 0.0)
        return now;
    if (h->rows == 0 || from < row_of(h, 0)[0] - hc_room(t))
        return h->before[k];
    if (row_of(h, h->rows - 1)[0] < t)
        n++; /* (t, now) is a node */
    while (high - low > 1) { /* the last row not after `from` */
        const size_t middle = low + (high - low) / 2;
        if (row_of(h, middle)[0] <= from + hc_room(from))
            low = middle;
        else
            high = middle;
    }
    high = low + 1;
    if (high >= n)
        return row_of(h, low)[1 + k];
    /* nodes low .. high, and one more on each side where there is no jump */
    for (int side = 0; side < 2; side++) {
        double a, b, other;
        if (side == 0 && low > 0) {
            node(h, low - 1, k, t, now, &a, &other);
            node(h, low, k, t, now, &b, &other);
            low -= a < b;
        } else if (side == 1 && high + 1 < n) {
            node(h, high, k, t, now, &a, &other);
            node(h, high + 1, k, t, now, &b, &other);
            high += a < b;
        }
    }
    n = high - low + 1;
    for (size_t i = 0; i < n; i++)
        node(h, low + i, k, t, now, at + i, value + i);
    for (size_t i = 0; i < n; i++) { /* sum of value_i prod_j (from - at_j) / (at_i - at_j) */
        double weight = 1.0;
        for (size_t j = 0; j < n; j++)
            if (j != i)
                weight *= (from - at[j]) / (at[i] - at[j]);
        sum += weight * value[i];
    }
    return sum;
}

size_t hc_history_count(const hc_history *h)
{
    return 2 + 2 * (size_t)h->n + h->rows * (size_t)(1 + h->n);
}

void hc_history_save(const hc_history *h, double *into)
{
    const size_t size = h->rows * (size_t)(1 + h->n);
    *into++ = (double)hc_history_count(h);
    *into++ = (double)h->rows;
    if (h->n > 0)
        memcpy(into, h->delay, 2 * (size_t)h->n * sizeof *into);
    into += 2 * h->n;
    if (size > 0)
        memcpy(into, row_of(h, 0), size * sizeof *into);
}

int hc_history_load(hc_history *h, const double *from, size_t count)
{
    const size_t width = (size_t)(1 + h->n);
    size_t rows;
    if (count < 2 + 2 * (size_t)h->n || from[0] != (double)count || !(from[1] >= 0.0 && from[1] <= (double)count))
        return 0;
    rows = (size_t)from[1];
    if (count != 2 + 2 * (size_t)h->n + rows * width)
        return 0;
    hc_history_clear(h);
    if (!reserve(h, rows))
        return 0;
    from += 2;
    if (h->n > 0)
        memcpy(h->delay, from, 2 * (size_t)h->n * sizeof *from);
    from += 2 * h->n;
    if (rows > 0)
        memcpy(h->row, from, rows * width * sizeof *from);
    h->rows = rows;
    return 1;
}
