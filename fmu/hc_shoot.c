/* See hc_shoot.h. HC_LANES windows go side by side, one copy after the other. */
#include "hc_shoot.h"

#include <stdlib.h>

typedef double pack[HC_LANES]; /* one number of each lane */

typedef struct {
    const hc_shoot *shoot;
    hc_lanes_function derivatives;
    pack *x, *end, *k1, *k2, *k3, *k4, *stage, *u, *p;
    pack t, h; /* begin and length of a piece */
    long window[HC_LANES]; /* of each lane; the last is repeated where windows run out */
    long copy, way;
} hc_shooter;

static void slope(void *system, double part, double *x, double *dx)
{
    const hc_shooter *s = system;
    pack t;
    HC_EACH_LANE
        t[l] = s->t[l] + part * s->h[l];
    s->derivatives(t, x, (const double *)s->u, (const double *)s->p, NULL, dx);
    for (int i = 0; i < s->shoot->n_known; i++)
        HC_EACH_LANE
            dx[s->shoot->known[i] * HC_LANES + l] = 0.0;
}

/* One number of each lane out of an array (signals, S, K-1, ways, W). */
static void arrive(const hc_shooter *s, const double *from, int signal, long piece, long row, double *into)
{
    const hc_shoot *d = s->shoot;
    const double *place = from + ((((long)signal * d->pieces + piece) * (d->rows - 1) + row) * d->ways + s->way) * d->windows;
    for (int l = 0; l < HC_LANES; l++)
        into[l] = place[s->window[l]];
}

static void one_piece(hc_shooter *s, long piece, long row)
{
    const hc_shoot *d = s->shoot;
    pack *begin = s->x;
    pack h; /* a copy that nobody can change from afar stays in registers */
    arrive(s, d->step, 0, piece, row, h);
    for (int l = 0; l < HC_LANES; l++) {
        s->t[l] = d->time[(piece * (d->rows - 1) + row) * d->windows + s->window[l]];
        s->h[l] = h[l];
    }
    for (int i = 0; i < d->n_inputs; i++)
        arrive(s, d->inputs, i, piece, row, s->u[i]);
    for (int i = 0; i < d->n_known; i++)
        arrive(s, d->values, i, piece, row, s->x[d->known[i]]);
    slope(s, 0.0, begin[0], s->k1[0]);
    hc_rk4_step(d->n_states, HC_LANES, slope, s, h, begin[0], s->k1[0], s->k2[0], s->k3[0], s->k4[0], s->stage[0],
                s->end[0]);
    s->x = s->end;
    s->end = begin;
}

static double *state(const hc_shooter *s, long row, int i)
{
    const hc_shoot *d = s->shoot;
    return d->states + ((row * d->n_states + i) * d->copies + s->copy) * d->windows;
}

static void one_copy(hc_shooter *s, int count)
{
    const hc_shoot *d = s->shoot;
    for (int i = 0; i < d->n_parameters; i++)
        for (int l = 0; l < HC_LANES; l++)
            s->p[i][l] = d->parameters[i * d->copies + s->copy];
    for (int i = 0; i < d->n_states; i++)
        for (int l = 0; l < HC_LANES; l++)
            s->x[i][l] = state(s, 0, i)[s->window[l]];
    for (long row = 0; row < d->rows - 1; row++) {
        for (long piece = 0; piece < d->pieces; piece++)
            one_piece(s, piece, row);
        for (int i = 0; i < d->n_states; i++)
            for (int l = 0; l < count; l++)
                state(s, row + 1, i)[s->window[l]] = s->x[i][l];
    }
}

int hc_shoot_run(const hc_shoot *shoot, hc_lanes_function derivatives, long from, long to)
{
    const int n = shoot->n_states;
    const size_t packs = (size_t)(7 * n + shoot->n_inputs + shoot->n_parameters);
    pack *block = calloc(packs + 1, sizeof *block);
    hc_shooter s = {.shoot = shoot, .derivatives = derivatives};
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
    for (long first = from; first < to; first += HC_LANES) {
        const int count = to - first < HC_LANES ? (int)(to - first) : HC_LANES;
        for (int l = 0; l < HC_LANES; l++)
            s.window[l] = first + (l < count ? l : count - 1);
        for (s.copy = 0; s.copy < shoot->copies; s.copy++) {
            s.way = shoot->ways > 1 ? s.copy : 0;
            one_copy(&s, count);
        }
    }
    free(block);
    return 0;
}
