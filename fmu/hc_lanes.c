/* Classical Runge-Kutta for HC_LANES runs at once. A lane takes only steps without events. If a friction has an event,
 * a row of results is reached, an input jumps or a value is not finite, the run's own solver repeats that step. It
 * also takes all steps while a velocity sticks. All special cases are thus in one solver; this file only adds speed.
 */
#include "hc_runs.h"

#include <stdlib.h>

typedef double pack[HC_LANES]; /* one value per lane */

struct hc_lanes {
    const hc_model_type *model;
    hc_lanes_function derivatives;
    double step;
    double *block;
    pack *x, *f, *x1, *f1, *k2, *k3, *k4, *stage, *u, *p, *mode;
    pack t, h, event, earliest, latest; /* event: next time at which the run's own solver is needed */
    int rides[HC_LANES];                /* 1: the lane steps its run; 0: the run's own solver does, and h is 0 */
};

static pack *take(double **block, int n)
{
    pack *here = (pack *)*block;
    *block += n * HC_LANES;
    return here;
}

hc_lanes *hc_lanes_new(const hc_model_type *model, hc_lanes_function derivatives, double step)
{
    const int n = model->n_states;
    const int packs = 8 * n + model->n_inputs + model->n_parameters + model->n_friction;
    hc_lanes *s = calloc(1, sizeof *s);
    double *block = calloc((size_t)packs * HC_LANES + 1, sizeof *block);
    if (!s || !block) {
        free(s);
        free(block);
        return NULL;
    }
    s->model = model;
    s->derivatives = derivatives;
    s->step = step;
    s->block = block;
    s->x = take(&block, n);
    s->f = take(&block, n);
    s->x1 = take(&block, n);
    s->f1 = take(&block, n);
    s->k2 = take(&block, n);
    s->k3 = take(&block, n);
    s->k4 = take(&block, n);
    s->stage = take(&block, n);
    s->u = take(&block, model->n_inputs);
    s->p = take(&block, model->n_parameters);
    s->mode = take(&block, model->n_friction);
    return s;
}

void hc_lanes_free(hc_lanes *s)
{
    if (s)
        free(s->block);
    free(s);
}

/* ---- runs enter and leave lanes ---- */

static void put(pack *into, int l, const double *from, int n)
{
    for (int i = 0; i < n; i++)
        into[i][l] = from[i];
}

static void load(hc_lanes *s, int l, const hc_run *run)
{
    const hc_solver *own = run->solver;
    const double row = run->grid->times[run->row];
    put(s->x, l, own->x, own->n);
    put(s->f, l, own->f, own->n);
    put(s->u, l, own->u, s->model->n_inputs);
    put(s->p, l, own->p, s->model->n_parameters);
    for (int k = 0; k < s->model->n_friction; k++)
        s->mode[k][l] = own->mode[k];
    s->t[l] = own->t;
    s->earliest[l] = own->earliest;
    s->latest[l] = own->latest;
    s->event[l] = row < own->next_switch ? row : own->next_switch;
}

/* Move a run into its lane if it can be stepped there. */
static void get_on(hc_lanes *s, int l, hc_run *run)
{
    hc_solver *own = run->solver;
    if (!hc_run_goes_on(run) || own->t >= own->next_switch)
        return;
    for (int k = 0; k < own->n_friction; k++)
        if (own->mode[k] == 0)
            return;
    if (!own->fresh)
        hc_right_hand_side(own, own->t, own->x, own->f);
    for (int i = 0; i < own->n; i++)
        if (!hc_is_finite(own->f[i]))
            return;
    own->fresh = 1;
    load(s, l, run);
    s->h[l] = s->step;
    s->rides[l] = 1;
}

/* Return a run to its own solver, in the state before the step that was just tried. */
static void get_off(hc_lanes *s, int l, hc_run *run)
{
    hc_solver *own = run->solver;
    for (int i = 0; i < own->n; i++) {
        own->x[i] = s->x[i][l];
        own->f[i] = s->f[i][l];
    }
    own->t = s->t[l];
    own->fresh = 1;
    own->length = 0.0;
    own->has_dense = 0;
    s->rides[l] = 0;
    s->h[l] = 0.0;
}

/* ---- a step ---- */

/* t + part * h, kept before the next switch; see hc_model_time. */
static void slope(void *system, double part, double *x, double *dx)
{
    const hc_lanes *s = system;
    pack t;
    HC_EACH_LANE {
        const double at = s->t[l] + part * s->h[l];
        t[l] = at < s->earliest[l] ? s->earliest[l] : at > s->latest[l] ? s->latest[l] : at;
    }
    s->derivatives(t, x, (const double *)s->u, (const double *)s->p, (const double *)s->mode, dx);
}

/* From x, f over h to x1, f1. */
static void try_step(hc_lanes *s)
{
    hc_rk4_step(s->model->n_states, HC_LANES, slope, s, s->h, s->x[0], s->f[0], s->k2[0], s->k3[0], s->k4[0],
                s->stage[0], s->x1[0]);
    slope(s, 1.0, s->x1[0], s->f1[0]);
}

/* Mark the lanes whose step to x1, f1 must be repeated by the run's own solver. */
static void look(const hc_lanes *s, double *special)
{
    pack zero = {0.0};
    for (int i = 0; i < s->model->n_states; i++)
        HC_EACH_LANE
            zero[l] += 0.0 * s->x1[i][l] + 0.0 * s->f1[i][l];
    HC_EACH_LANE
        special[l] = (zero[l] == 0.0 ? 0.0 : 1.0) + (s->t[l] + (1.0 + 1e-9) * s->h[l] >= s->event[l] ? 1.0 : 0.0);
    for (int k = 0; k < s->model->n_friction; k++) {
        const int i = s->model->friction_state[k];
        HC_EACH_LANE {
            const double mode = s->mode[k][l], turns = mode * s->f[i][l] < 0.0 ? mode * s->f1[i][l] : 0.0;
            special[l] += mode * s->x1[i][l] < 0.0 ? 1.0 : turns > 0.0 ? 1.0 : 0.0; /* as in hc_events.c */
        }
    }
}

static void step_all(hc_lanes *s, hc_run *runs, int count)
{
    pack special;
    try_step(s);
    look(s, special);
    for (int l = 0; l < count; l++)
        if (s->rides[l] && special[l] > 0.0)
            get_off(s, l, &runs[l]);
    HC_EACH_LANE
        s->t[l] += s->h[l];
    pack *x = s->x, *f = s->f;
    s->x = s->x1;
    s->x1 = x;
    s->f = s->f1;
    s->f1 = f;
}

void hc_lanes_run(hc_lanes *s, hc_run *runs, int count)
{
    int going = 1;
    for (int l = 0; l < HC_LANES; l++) { /* lanes without a run hold the initial state of the first */
        const int own = l < count ? l : 0;
        if (hc_run_goes_on(&runs[own]))
            load(s, l, &runs[own]);
        s->rides[l] = 0;
        s->h[l] = 0.0;
    }
    for (int l = 0; l < count; l++)
        get_on(s, l, &runs[l]);
    while (going) {
        int ride = 0;
        for (int l = 0; l < count; l++)
            ride |= s->rides[l];
        if (ride)
            step_all(s, runs, count);
        going = 0;
        for (int l = 0; l < count; l++) {
            if (!s->rides[l] && hc_run_goes_on(&runs[l])) {
                hc_run_step(&runs[l]);
                get_on(s, l, &runs[l]);
            }
            going |= hc_run_goes_on(&runs[l]);
        }
    }
}
