/* Events of dry friction within a step: a velocity reaches zero, or breaks away from it.
 *
 * Root finding: Oliveira and Takahashi (2021), ACM TOMS 47(1).
 */
#include "hc_friction.h"
#include "hc_solver_internal.h"

#define NO_EVENT 2.0       /* any theta after the end of the step, 1 */
#define SMOOTH (-1.0)      /* a velocity changed sign while its friction is zero: no event */
#define ROOT_WIDTH 1e-13   /* fraction of a step */
#define AT_ONCE 1e-6       /* fraction of a step; a shorter slip is ignored */
#define MAX_AT_ONE_TIME 50 /* events without progress in time; 10 more for each friction */

static void friction(hc_solver *s, double t, const double *x, double *a, double *b)
{
    s->model->friction(hc_model_time(s, t), x, s->u, s->p, s->mode, a, b);
}

/* Event function of friction k: it rises through zero at the event. */
static double event_value(hc_solver *s, int k, double theta)
{
    if (s->mode[k] != 0)
        return -s->mode[k] * hc_interpolate_one(s, s->model->friction_state[k], theta);
    hc_interpolate(s, theta, s->stage);
    friction(s, s->t0 + theta * s->length, s->stage, s->a, s->b);
    return hc_friction_excess(s->a[k], s->b[k]);
}

/* Bracket the event between low (before) and high (after) by ITP; return the upper end. */
static double locate(hc_solver *s, int k, double low, double high)
{
    const double clock = 4.0 * DBL_EPSILON * fabs(s->t0) / s->length;
    const double width = clock > ROOT_WIDTH ? clock : ROOT_WIDTH, whole = high - low;
    double at_low = event_value(s, k, low), at_high = event_value(s, k, high);
    double slack = width;
    while (slack < whole)
        slack *= 2.0;
    if (at_low > 0.0)
        return low;
    for (; high - low > width; slack *= 0.5) {
        const double middle = 0.5 * (low + high), secant = (at_high * low - at_low * high) / (at_high - at_low);
        const double side = middle >= secant ? 1.0 : -1.0;
        const double shift = 0.2 * (high - low) * (high - low) / whole, reach = slack - 0.5 * (high - low);
        const double tried = shift <= fabs(middle - secant) ? secant + side * shift : middle;
        const double theta = fabs(tried - middle) <= reach ? tried : middle - side * reach;
        const double value = event_value(s, k, theta);
        if (value > 0.0) {
            high = theta;
            at_high = value;
        } else {
            low = theta;
            at_low = value;
        }
    }
    return high;
}

/* A theta at which slipping velocity k has passed zero, or NO_EVENT. Checked at the end and at the extremum inside. */
static double past_zero(hc_solver *s, int k)
{
    const int i = s->model->friction_state[k], sign = s->mode[k];
    double low = 0.0, high = 1.0;
    if (sign * s->x[i] < 0.0)
        return 1.0;
    if (!(sign * s->f0[i] < 0.0 && sign * s->f[i] > 0.0))
        return NO_EVENT;
    if (!s->has_dense)
        hc_make_dense(s);
    for (int halving = 0; halving < 20; halving++) {
        const double middle = 0.5 * (low + high);
        const double slope = hc_interpolate_one(s, i, middle + 1e-7) - hc_interpolate_one(s, i, middle - 1e-7);
        if (sign * slope < 0.0)
            low = middle;
        else
            high = middle;
    }
    return sign * hc_interpolate_one(s, i, low) < 0.0 ? low : NO_EVENT;
}

/* Theta at which slipping velocity k reaches zero, given a later theta. */
static double end_of_slip(hc_solver *s, int k, double past)
{
    double low = 0.0;
    friction(s, s->t0, s->x0, s->a, s->b);
    if (s->b[k] == 0.0) {
        friction(s, s->t0 + s->length, s->x, s->a, s->b);
        if (s->b[k] == 0.0)
            return SMOOTH;
    }
    if (!s->has_dense)
        hc_make_dense(s);
    if (s->x0[s->model->friction_state[k]] == 0.0) { /* it started from rest in this step */
        for (low = 0.5 * past; event_value(s, k, low) >= 0.0; low *= 0.5)
            if (low < AT_ONCE)
                return low; /* it did not leave zero */
    }
    return locate(s, k, low, past);
}

/* Write into theta where each sticking velocity breaks away. Returns 0 if the force varies too fast within the step to
 * be sampled; error control cannot see it, as states at rest have no error. */
static int breakaways(hc_solver *s)
{
    const int m = s->n_friction, last = HC_SAMPLES - 1, every = s->cubic ? 2 : 1; /* fewer samples for a short step */
    int resolved = 1, any = 0;
    if (!s->has_dense)
        hc_make_dense(s);
    friction(s, s->t0, s->x0, s->a, s->b);
    for (int j = every; j < last; j += every) {
        const double theta = (double)j / last;
        hc_interpolate(s, theta, s->stage);
        friction(s, s->t0 + theta * s->length, s->stage, s->a + j * m, s->b + j * m);
    }
    friction(s, s->t0 + s->length, s->x, s->a + last * m, s->b + last * m);
    for (int k = 0; k < m; k++) {
        const double *a = s->a + k, *b = s->b + k;
        if (s->mode[k] != 0)
            continue;
        for (int j = every; j <= last && s->theta[k] == NO_EVENT; j += every)
            if (hc_friction_excess(a[j * m], b[j * m]) > 0.0) {
                s->theta[k] = (double)j / last;
                any = 1;
            }
        const double bend = s->cubic ? a[0] - 2.0 * a[2 * m] + a[4 * m]
                                     : a[0] - 4.0 * a[m] + 6.0 * a[2 * m] - 4.0 * a[3 * m] + a[4 * m];
        if (fabs(bend) > 0.02 * fabs(b[4 * m]))
            resolved = 0;
    }
    for (int k = 0; k < m; k++) /* locate overwrites the samples */
        if (s->mode[k] == 0 && s->theta[k] != NO_EVENT)
            s->theta[k] = locate(s, k, s->theta[k] - (double)every / last, s->theta[k]);
    return resolved || any;
}

int hc_look_for_events(hc_solver *s)
{
    int sticking = 0;
    for (int k = 0; k < s->n_friction; k++) {
        s->theta[k] = NO_EVENT;
        if (s->mode[k] == 0) {
            sticking = 1;
        } else {
            const double past = past_zero(s, k);
            if (past <= 1.0)
                s->theta[k] = end_of_slip(s, k, past);
        }
    }
    return sticking ? breakaways(s) : 1;
}

int hc_pass_events(hc_solver *s)
{
    const int m = s->n_friction;
    double first = NO_EVENT;
    for (int k = 0; k < m; k++)
        if (s->theta[k] != SMOOTH && s->theta[k] < first)
            first = s->theta[k];
    if (first <= 1.0) {
        hc_interpolate(s, first, s->x);
        if (first < 1.0)
            s->t = s->t0 + first * s->length;
        s->fresh = 0;
    }
    for (int k = 0; k < m; k++) {
        double *v = s->x + s->model->friction_state[k];
        if (s->theta[k] == SMOOTH) {
            if (*v != 0.0)
                s->mode[k] = *v < 0.0 ? -1 : 1;
        } else if (first <= 1.0 && s->theta[k] <= first + ROOT_WIDTH) {
            *v = 0.0;
            s->counts[HC_EVENTS]++;
            if (s->mode0[k] != 0)
                s->mode[k] = 0;
        }
    }
    if (first > 1.0)
        return HC_OK;
    if (s->t - s->t_event > 10.0 * AT_ONCE * s->length + 64.0 * DBL_EPSILON * fabs(s->t))
        s->events_here = 0;
    s->t_event = s->t;
    if (++s->events_here > MAX_AT_ONE_TIME + 10 * m)
        return HC_STEP_TOO_SMALL;
    return hc_friction_modes(s->model, hc_model_time(s, s->t), s->x, s->u, s->p, s->mode, s->a, s->b);
}
