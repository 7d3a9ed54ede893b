/* The solver of hc_solver.h: memory, the loop over steps, and the events that end a step. */
#include "hc_friction.h"
#include "hc_methods.h"

#include <stdlib.h>
#include <string.h>

/* ---- memory ---- */

static double *take(double **block, int n)
{
    double *here = *block;
    *block += (n + 7) / 8 * 8;
    return here;
}

hc_solver *hc_solver_new(const hc_model_type *model, const hc_options *options)
{
    const int n = model->n_states, m = model->n_friction;
    const int n_k = options->method == HC_DOP853 ? HC_MOST_STAGES : 5;
    const int n_dense = options->method == HC_DOP853 ? HC_MOST_DENSE : 5;
    const size_t doubles = (size_t)(6 + n_k + n_dense) * ((size_t)n + 8) + ((size_t)model->n_inputs + 8) +
                           ((size_t)model->n_parameters + 8) + 2 * ((size_t)HC_SAMPLES * (size_t)m + 8) +
                           ((size_t)m + 8) + hc_ticks_size(model);
    hc_solver *s = calloc(1, sizeof *s);
    double *block = calloc(doubles, sizeof *block);
    int *modes = calloc(2 * (size_t)m + 1, sizeof *modes);
    if (!s || !block || !modes) {
        free(s);
        free(block);
        free(modes);
        return NULL;
    }
    s->model = model;
    s->n = s->n_mean = n - model->n_held;
    s->n_held = model->n_held;
    s->n_friction = m;
    s->method = options->method;
    s->longest = options->step > 0 ? options->step : DBL_MAX;
    s->max_steps = options->max_steps;
    s->absolute = take(&block, n); /* first: hc_solver_free frees the block by this address */
    s->x = take(&block, n);
    s->f = take(&block, n);
    s->x0 = take(&block, n);
    s->f0 = take(&block, n);
    s->stage = take(&block, n);
    s->n_k = n_k;
    s->n_dense = n_dense;
    for (int j = 0; j < n_k; j++)
        s->k[j] = take(&block, n);
    for (int j = 0; j < n_dense; j++)
        s->dense[j] = take(&block, n);
    s->u = take(&block, model->n_inputs);
    s->p = take(&block, model->n_parameters);
    s->a = take(&block, HC_SAMPLES * m);
    s->b = take(&block, HC_SAMPLES * m);
    s->theta = take(&block, m);
    hc_ticks_place(&s->ticks, model, HC_TICK_SHARE, block);
    s->mode = modes;
    s->mode0 = modes + m;
    hc_solver_tolerance(s, options->rtol, options->atol, options->nominal);
    s->t_event = -DBL_MAX;
    s->next_switch = s->quiet_from = DBL_MAX;
    return s;
}

void hc_solver_free(hc_solver *s)
{
    if (!s)
        return;
    free(s->mode);
    free(s->absolute);
    free(s);
}

void hc_solver_tolerance(hc_solver *s, double rtol, double atol, const double *nominal)
{
    s->rtol = rtol;
    for (int i = 0; i < s->n; i++)
        s->absolute[i] = atol * (nominal ? nominal[i] : 1.0);
}

static void swap(double **one, double **other)
{
    double *kept = *one;
    *one = *other;
    *other = kept;
}

/* Between two switches the model's conditions on time are constant; the bounds allow for rounding. */
static void look_for_switch(hc_solver *s)
{
    double next = DBL_MAX;
    s->earliest = -DBL_MAX;
    if (s->model->next_switch) {
        next = s->model->next_switch(s->t + hc_room(s->t), s->p);
        if (next < DBL_MAX || s->next_switch < DBL_MAX)
            s->earliest = s->t + hc_room(s->t);
    }
    s->next_switch = next;
    s->latest = next < DBL_MAX ? next - hc_room(next) : DBL_MAX;
}

static int find_modes(hc_solver *s)
{
    for (int k = 0; k < s->n_friction; k++) {
        const double v = s->x[s->model->friction_state[k]];
        s->mode[k] = v > 0.0 ? 1 : v < 0.0 ? -1 : 0;
    }
    if (s->n_friction == 0)
        return HC_OK;
    return hc_friction_modes(s->model, hc_model_time(s, s->t), s->x, s->u, s->p, s->mode, s->a, s->b);
}

/* Update modes and derivatives after held states have changed. */
static int after_ticks(hc_solver *s)
{
    s->fresh = 0;
    if (!hc_all_finite(s->n_held, s->x + s->n))
        return HC_NOT_FINITE;
    return find_modes(s);
}

static int pass_ticks(hc_solver *s)
{
    s->ticks.ticked = s->ticks.ticked && hc_ticks_same(&s->ticks, s->ticks.at, s->t);
    if (!hc_ticks_due(&s->ticks, s->t) || s->t >= s->quiet_from)
        return HC_OK;
    hc_ticks_take(&s->ticks, s->t, s->x, s->u, s->p, s->mode);
    return after_ticks(s);
}

/* No continuous states: nothing changes between ticks. */
static int step_over(hc_solver *s, double stop)
{
    hc_ticks_hold(s->model, s->x0, s->x);
    s->t0 = s->t;
    s->length = stop - s->t;
    s->t = stop;
    s->f_open = s->has_dense = 0;
    return pass_ticks(s);
}

int hc_solver_step(hc_solver *s, double stop)
{
    int status;
    if (stop <= s->t)
        return HC_OK;
    if (s->t >= s->next_switch) { /* restart after it */
        look_for_switch(s);
        s->fresh = 0;
    }
    if (stop > s->next_switch)
        stop = s->next_switch;
    if (hc_ticks_before(&s->ticks, stop))
        stop = s->ticks.next;
    if (s->n == 0)
        return step_over(s, stop);
    hc_ticks_hold(s->model, s->stage, s->x);
    if (!s->fresh) {
        hc_right_hand_side(s, s->t, s->x, s->f);
        if (!hc_all_finite(s->n, s->f))
            return HC_NOT_FINITE;
        s->fresh = 1;
    }
    if (s->h == 0.0 && s->method != HC_RK4)
        s->h = hc_first_length(s);
    s->t0 = s->t;
    swap(&s->x, &s->x0);
    swap(&s->f, &s->f0);
    hc_ticks_hold(s->model, s->x, s->x0);
    s->cubic = 0;
    if (s->n_friction > 0)
        memcpy(s->mode0, s->mode, (size_t)s->n_friction * sizeof *s->mode);
    status = hc_choose_and_step(s, stop);
    if (status != HC_OK) { /* back to the last good time */
        swap(&s->x, &s->x0);
        swap(&s->f, &s->f0);
        s->length = 0.0;
        return status;
    }
    s->counts[HC_ACCEPTED]++;
    s->t = s->length == stop - s->t0 ? stop : s->t0 + s->length;
    s->fresh = s->method != HC_RK4 || s->n_friction > 0;
    s->f_open = !s->fresh;
    if (s->n_friction > 0)
        status = hc_pass_events(s);
    return status == HC_OK ? pass_ticks(s) : status;
}

/* ---- public functions ---- */

void hc_solver_restart(hc_solver *s)
{
    s->h = 0.0;
    s->log_error = 0.0;
    s->steps = 0;
    s->t_event = -DBL_MAX;
}

int hc_solver_set(hc_solver *s, double t, const double *x, const double *u, const double *p)
{
    const int anew = x || t != s->t || !s->started;
    int status;
    s->t = t;
    if (x)
        memcpy(s->x, x, (size_t)(s->n + s->n_held) * sizeof *x);
    if (u)
        memcpy(s->u, u, (size_t)s->model->n_inputs * sizeof *u);
    if (p)
        memcpy(s->p, p, (size_t)s->model->n_parameters * sizeof *p);
    s->started = 1;
    look_for_switch(s);
    s->fresh = s->f_open = 0;
    s->has_dense = 0;
    s->length = 0.0;
    s->events_here = 0;
    if (anew)
        hc_ticks_start(&s->ticks, t);
    status = find_modes(s);
    if (status != HC_OK || s->model->n_ticks == 0)
        return status;
    if (anew)
        return pass_ticks(s);
    if (!s->ticks.ticked)
        return HC_OK;
    hc_ticks_again(&s->ticks, t, s->x, s->u, s->p, s->mode);
    return after_ticks(s);
}

int hc_solver_advance(hc_solver *s, double until)
{
    int status = HC_OK;
    s->steps = 0;
    while (status == HC_OK && s->t < until)
        status = hc_solver_step(s, until);
    return status;
}

double hc_solver_time(const hc_solver *s)
{
    return s->t;
}

const double *hc_solver_states(const hc_solver *s)
{
    return s->x;
}

const int *hc_solver_modes(const hc_solver *s)
{
    return s->mode;
}

void hc_solver_counts(const hc_solver *s, long counts[4])
{
    memcpy(counts, s->counts, sizeof s->counts);
}
