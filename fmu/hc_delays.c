/* Delayed inputs: a queue of values with arrival times for each. */
#define HC_DELAYS 1
#include "hc_delays.h"

#include <stdlib.h>
#include <string.h>

#include "hc_numbers.h"

typedef struct {
    double delay, sent;      /* value set last */
    double *message;         /* pairs of time and value; `n` from `first` on are pending */
    size_t first, n, room;
} late_type;

struct hc_delays {
    int n_inputs;
    double *in;
    late_type late[];
};

hc_delays *hc_delays_new(int n_inputs)
{
    const size_t n = (size_t)hc_late.n_late;
    hc_delays *d = calloc(1, sizeof *d + n * sizeof *d->late);
    if (!d)
        return NULL;
    d->n_inputs = n_inputs;
    d->in = calloc((size_t)n_inputs + n, sizeof *d->in); /* n more: delays to be validated */
    if (!d->in) {
        free(d);
        return NULL;
    }
    return d;
}

void hc_delays_free(hc_delays *d)
{
    if (!d)
        return;
    for (int k = 0; k < hc_late.n_late; k++)
        free(d->late[k].message);
    free(d->in);
    free(d);
}

double *hc_delays_inputs(hc_delays *d)
{
    return d->in;
}

int hc_delays_fixed(int parameter)
{
    for (int k = 0; k < hc_late.n_fixed; k++)
        if (hc_late.parameter[k] == parameter)
            return 1;
    return 0;
}

int hc_delays_rest(hc_delays *d, const double *u, const double *start, const double *p)
{
    double *delay = d->in + d->n_inputs;
    int wrong = -1;
    hc_late.seconds(p, delay);
    memcpy(d->in, u, (size_t)d->n_inputs * sizeof *u);
    for (int k = 0; k < hc_late.n_late; k++) {
        const int i = hc_late.input[k];
        d->late[k].delay = delay[k];
        d->late[k].n = 0;
        d->late[k].sent = start[i];
        if (!(delay[k] >= 0.0 && delay[k] <= DBL_MAX))
            wrong = k;
        if (delay[k] != 0.0)
            d->in[i] = start[i];
    }
    return wrong;
}

/* Reserve room for n messages; 0 if there is no memory. */
static int reserve(late_type *late, size_t n)
{
    double *more;
    size_t room = late->room ? late->room : 16;
    if (n <= late->room)
        return 1;
    while (room < n)
        room *= 2;
    more = malloc(2 * room * sizeof *more);
    if (!more)
        return 0;
    if (late->n > 0)
        memcpy(more, late->message + 2 * late->first, 2 * late->n * sizeof *more);
    free(late->message);
    late->message = more;
    late->first = 0;
    late->room = room;
    return 1;
}

static int send(late_type *late, double at, double value)
{
    double *last = late->n > 0 ? late->message + 2 * (late->first + late->n - 1) : NULL;
    if (!last || last[0] < at) {
        const int at_end = late->first + late->n == late->room;
        if (at_end && 2 * late->n >= late->room) {
            if (!reserve(late, late->room + 1))
                return 0;
        } else if (at_end) { /* back to the beginning of the memory */
            memmove(late->message, late->message + 2 * late->first, 2 * late->n * sizeof *late->message);
            late->first = 0;
        }
        last = late->message + 2 * (late->first + late->n++);
        last[0] = at;
    }
    last[1] = value;
    late->sent = value;
    return 1;
}

int hc_delays_send_prompt(hc_delays *d, const double *u)
{
    int waits = 0, k = 0; /* hc_late.input is sorted */
    for (int i = 0; i < d->n_inputs; i++)
        if (k < hc_late.n_late && hc_late.input[k] == i)
            waits |= u[i] != d->late[k++].sent;
        else
            d->in[i] = u[i];
    return waits;
}

int hc_delays_send(hc_delays *d, double t, const double *u)
{
    if (!hc_delays_send_prompt(d, u))
        return 1;
    for (int k = 0; k < hc_late.n_late; k++) {
        late_type *late = d->late + k;
        const int i = hc_late.input[k];
        if (late->delay == 0.0)
            d->in[i] = late->sent = u[i];
        else if (u[i] != late->sent && !send(late, t + late->delay, u[i]))
            return 0;
    }
    return 1;
}

double hc_delays_next(const hc_delays *d)
{
    double next = DBL_MAX;
    for (int k = 0; k < hc_late.n_late; k++) {
        const late_type *late = d->late + k;
        if (late->n > 0 && late->message[2 * late->first] < next)
            next = late->message[2 * late->first];
    }
    return next;
}

int hc_delays_arrive(hc_delays *d, double t)
{
    int changed = 0;
    for (int k = 0; k < hc_late.n_late; k++) {
        late_type *late = d->late + k;
        double *in = d->in + hc_late.input[k];
        const double before = *in;
        for (; late->n > 0 && late->message[2 * late->first] <= t + hc_room(t); late->first++, late->n--)
            *in = late->message[2 * late->first + 1];
        if (late->n == 0)
            late->first = 0;
        changed |= *in != before;
    }
    return changed;
}

void hc_delays_mask(const hc_delays *d, double *inputs)
{
    for (int k = 0; k < hc_late.n_late; k++)
        if (d->late[k].delay != 0.0)
            inputs[hc_late.input[k]] = 0.0;
}

/* ---- saved state, as doubles: the count, `in`, and a header and the messages of each delayed input ---- */

enum { N_HEAD = 3 };

size_t hc_delays_count(const hc_delays *d)
{
    size_t count = 1 + (size_t)d->n_inputs;
    for (int k = 0; k < hc_late.n_late; k++)
        count += N_HEAD + 2 * d->late[k].n;
    return count;
}

void hc_delays_save(const hc_delays *d, double *into)
{
    *into++ = (double)hc_delays_count(d);
    memcpy(into, d->in, (size_t)d->n_inputs * sizeof *into);
    into += d->n_inputs;
    for (int k = 0; k < hc_late.n_late; k++) {
        const late_type *late = d->late + k;
        *into++ = late->delay;
        *into++ = late->sent;
        *into++ = (double)late->n;
        if (late->n > 0)
            memcpy(into, late->message + 2 * late->first, 2 * late->n * sizeof *into);
        into += 2 * late->n;
    }
}

int hc_delays_fit(hc_delays *d, const double *from, size_t count)
{
    size_t at = 1 + (size_t)d->n_inputs;
    if (count < at || from[0] != (double)count)
        return 0;
    for (int k = 0; k < hc_late.n_late; k++) {
        if (count - at < N_HEAD)
            return 0;
        const double n = from[at + N_HEAD - 1];
        at += N_HEAD;
        if (!(n >= 0.0 && 2.0 * n <= (double)(count - at)) || !reserve(d->late + k, (size_t)n))
            return 0;
        at += 2 * (size_t)n;
    }
    return at == count;
}

void hc_delays_load(hc_delays *d, const double *from)
{
    from++;
    memcpy(d->in, from, (size_t)d->n_inputs * sizeof *from);
    from += d->n_inputs;
    for (int k = 0; k < hc_late.n_late; k++) {
        late_type *late = d->late + k;
        late->delay = *from++;
        late->sent = *from++;
        late->n = (size_t)*from++;
        late->first = 0;
        if (late->n > 0)
            memcpy(late->message, from, 2 * late->n * sizeof *from);
        from += 2 * late->n;
    }
}
