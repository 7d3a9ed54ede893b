/* See hc_shoot.h. HC_LANES windows are integrated at once. */
#include "hc_shoot.h"

#include <stdlib.h>
#include <string.h>

typedef double pack[HC_LANES]; /* one value per lane */

typedef struct {
    const hc_shoot *shoot;
    hc_lanes_function derivatives;
    const hc_slopes *slopes;
    int size; /* integrated values: states, then their slopes by state and column */
    pack *value; /* partial derivatives */
    pack *x, *end, *k1, *k2, *k3, *k4, *stage, *u, *p;
    pack t, h; /* begin and length of a piece */
    long window[HC_LANES]; /* window of each lane; the last is repeated if there are fewer windows than lanes */
} hc_shooter;

/* Derivatives of the slopes `of` states, from partial derivatives; all slopes of a state are contiguous. A partial
 * derivative that is not finite, such as that of a speed at rest, counts as zero. */
static void vary(const hc_shooter *s, const pack *of, pack *change)
{
    const hc_shoot *d = s->shoot;
    const int columns = d->n_columns;
    memset(change, 0, (size_t)(d->n_states * columns) * sizeof *change);
    for (int k = 0; k < s->slopes->n; k++) {
        const int column = s->slopes->column[k];
        pack *to = change + s->slopes->row[k] * columns;
        pack value;
        HC_EACH_LANE {
            const double found = s->value[k][l];
            value[l] = found - found == 0.0 ? found : 0.0;
        }
        if (column < d->n_states) {
            const pack *from = of + column * columns;
            for (int c = 0; c < columns; c++)
                HC_EACH_LANE
                    to[c][l] += value[l] * from[c][l];
        } else if (d->of_parameter[column - d->n_states] >= 0) {
            to += d->of_parameter[column - d->n_states];
            HC_EACH_LANE
                to[0][l] += value[l];
        }
    }
    for (int i = 0; i < d->n_known; i++)
        memset(change + d->known[i] * columns, 0, (size_t)columns * sizeof *change);
}

static void slope(void *system, double part, double *x, double *dx)
{
    const hc_shooter *s = system;
    const int n = s->shoot->n_states;
    const double *u = s->u[0], *p = s->p[0];
    pack t;
    HC_EACH_LANE
        t[l] = s->t[l] + part * s->h[l];
    if (s->shoot->n_columns) {
        s->slopes->function(t, x, u, p, NULL, dx, s->value[0]);
        vary(s, (const pack *)x + n, (pack *)dx + n);
    } else {
        s->derivatives(t, x, u, p, NULL, dx);
    }
    for (int i = 0; i < s->shoot->n_known; i++)
        HC_EACH_LANE
            dx[s->shoot->known[i] * HC_LANES + l] = 0.0;
}

/* One value per lane from an array (signals, S, K-1, W). */
static void arrive(const hc_shooter *s, const double *from, int signal, long piece, long row, double *into)
{
    const hc_shoot *d = s->shoot;
    const double *place = from + (((long)signal * d->pieces + piece) * (d->rows - 1) + row) * d->windows;
    for (int l = 0; l < HC_LANES; l++)
        into[l] = place[s->window[l]];
}

/* x + h k1: the next value of a sampled model whose rate is (next - x)/h */
static void euler_step(const hc_shooter *s, const double *h)
{
    for (int i = 0; i < s->size; i++)
        HC_EACH_LANE
            s->end[i][l] = s->x[i][l] + h[l] * s->k1[i][l];
}

static void one_piece(hc_shooter *s, long piece, long row)
{
    const hc_shoot *d = s->shoot;
    pack *begin = s->x;
    pack h; /* a local copy stays in registers */
    arrive(s, d->step, 0, piece, row, h);
    arrive(s, d->time, 0, piece, row, s->t);
    memcpy(s->h, h, sizeof h);
    for (int i = 0; i < d->n_inputs; i++)
        arrive(s, d->inputs, i, piece, row, s->u[i]);
    for (int i = 0; i < d->n_known; i++)
        arrive(s, d->values, i, piece, row, s->x[d->known[i]]);
    slope(s, 0.0, begin[0], s->k1[0]);
    if (d->euler)
        euler_step(s, h);
    else
        hc_rk4_step(s->size, HC_LANES, slope, s, h, begin[0], s->k1[0], s->k2[0], s->k3[0], s->k4[0], s->stage[0],
                    s->end[0]);
    s->x = s->end;
    s->end = begin;
}

static double *state(const hc_shooter *s, long row, int i)
{
    const hc_shoot *d = s->shoot;
    return d->states + (row * d->n_states + i) * d->windows;
}

/* Slopes at the start of a run: that of each state by its own initial value is one. */
static void begin_slopes(hc_shooter *s)
{
    const hc_shoot *d = s->shoot;
    pack *slopes = s->x + d->n_states;
    memset(slopes, 0, (size_t)(d->n_states * d->n_columns) * sizeof *slopes);
    for (int i = 0; i < d->n_states; i++)
        for (int l = 0; l < HC_LANES && d->of_state[i] >= 0; l++)
            slopes[i * d->n_columns + d->of_state[i]][l] = 1.0;
}

static void end_slopes(const hc_shooter *s, int count)
{
    const hc_shoot *d = s->shoot;
    pack *slopes = s->x + d->n_states;
    for (long k = 0; k < (long)d->n_states * d->n_columns; k++)
        for (int l = 0; l < count; l++)
            d->slopes[k * d->windows + s->window[l]] = slopes[k][l];
}

static void run_lanes(hc_shooter *s, int count)
{
    const hc_shoot *d = s->shoot;
    for (int i = 0; i < d->n_parameters; i++)
        for (int l = 0; l < HC_LANES; l++)
            s->p[i][l] = d->parameters[i];
    for (int i = 0; i < d->n_states; i++)
        for (int l = 0; l < HC_LANES; l++)
            s->x[i][l] = state(s, 0, i)[s->window[l]];
    if (d->n_columns)
        begin_slopes(s);
    for (long row = 0; row < d->rows - 1; row++) {
        for (long piece = 0; piece < d->pieces; piece++)
            one_piece(s, piece, row);
        for (int i = 0; i < d->n_states; i++)
            for (int l = 0; l < count; l++)
                state(s, row + 1, i)[s->window[l]] = s->x[i][l];
    }
    if (d->n_columns)
        end_slopes(s, count);
}

int hc_shoot_run(const hc_shoot *shoot, hc_lanes_function derivatives, const hc_slopes *slopes, long from, long to)
{
    const int n = shoot->n_states * (1 + shoot->n_columns);
    const size_t packs = (size_t)(7 * n + shoot->n_inputs + shoot->n_parameters + slopes->n);
    pack *block = calloc(packs + 1, sizeof *block);
    hc_shooter s = {.shoot = shoot, .derivatives = derivatives, .slopes = slopes, .size = n};
    if (!block)
        return 1;
    s.x = block;
    s.end = s.x + n;
    s.k1 = s.end + n;
    s.k2 = s.k1 + n;
    s.k3 = s.k2 + n;
    s.k4 = s.k3 + n;
    s.stage = s.k4 + n;
    s.u = s.stage + n;
    s.p = s.u + shoot->n_inputs;
    s.value = s.p + shoot->n_parameters;
    for (long first = from; first < to; first += HC_LANES) {
        const int count = to - first < HC_LANES ? (int)(to - first) : HC_LANES;
        for (int l = 0; l < HC_LANES; l++)
            s.window[l] = first + (l < count ? l : count - 1);
        run_lanes(&s, count);
    }
    free(block);
    return 0;
}
