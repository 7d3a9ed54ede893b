/* The solver of hc_solver.h: a step of either method, its length, and what lies inside it.
 *
 * Method, step control and dense output: Dormand and Prince (1980) in Hairer, Norsett, Wanner, "Solving Ordinary
 * Differential Equations I", 2nd ed., II.4-II.6.
 */
#include "hc_friction.h"
#include "hc_solver_internal.h"

#include <stdlib.h>
#include <string.h>

#define SHORT 0.5           /* of the length to try next, where the last error was as small as this: */
#define SHORT_BEFORE (-12.0) /* logarithm, squared */
#define SHORT_ERROR 0.01    /* squared; the error that a short step may have */

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
    const size_t doubles = 16 * ((size_t)n + 8) + ((size_t)model->n_inputs + 8) + ((size_t)model->n_parameters + 8) +
                           2 * ((size_t)HC_SAMPLES * (size_t)m + 8) + ((size_t)m + 8) + hc_ticks_size(model);
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
    s->absolute = take(&block, n); /* first: hc_solver_free knows the block by it */
    s->x = take(&block, n);
    s->f = take(&block, n);
    s->x0 = take(&block, n);
    s->f0 = take(&block, n);
    s->stage = take(&block, n);
    for (int j = 0; j < 5; j++) {
        s->k[j] = take(&block, n);
        s->dense[j] = take(&block, n);
    }
    s->u = take(&block, model->n_inputs);
    s->p = take(&block, model->n_parameters);
    s->a = take(&block, HC_SAMPLES * m);
    s->b = take(&block, HC_SAMPLES * m);
    s->theta = take(&block, m);
    hc_ticks_place(&s->ticks, model, block);
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

/* ---- small things ---- */

static int all_finite(int n, const double *restrict value)
{
    double zero = 0.0;
    for (int i = 0; i < n; i++)
        zero += 0.0 * value[i];
    return zero == 0.0;
}

static void swap(double **one, double **other)
{
    double *kept = *one;
    *one = *other;
    *other = kept;
}

/* mean square, in four sums side by side */
static double mean_square(const hc_solver *s, const double *restrict e)
{
    const int n = s->n;
    double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        s0 += e[i] * e[i];
        s1 += e[i + 1] * e[i + 1];
        s2 += e[i + 2] * e[i + 2];
        s3 += e[i + 3] * e[i + 3];
    }
    for (; i < n; i++)
        s0 += e[i] * e[i];
    return ((s0 + s1) + (s2 + s3)) / s->n_mean;
}

/* ---- one step of each method: from x0, f0 over h to x, f ---- */

/* returns the mean square of the local error over its bound */
static double step_dormand_prince(hc_solver *s, double h)
{
    const int n = s->n;
    const double rtol = s->rtol, t = s->t0;
    const double *restrict x0 = s->x0, *restrict k1 = s->f0, *restrict absolute = s->absolute;
    double *restrict k2 = s->k[0], *restrict k3 = s->k[1], *restrict k4 = s->k[2], *restrict k5 = s->k[3];
    double *restrict k6 = s->k[4], *restrict k7 = s->f, *restrict x = s->x, *restrict z = s->stage;

    for (int i = 0; i < n; i++)
        z[i] = x0[i] + h * (1.0 / 5.0) * k1[i];
    hc_right_hand_side(s, t + 0.2 * h, z, k2);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + h * (3.0 / 40.0 * k1[i] + 9.0 / 40.0 * k2[i]);
    hc_right_hand_side(s, t + 0.3 * h, z, k3);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + h * (44.0 / 45.0 * k1[i] - 56.0 / 15.0 * k2[i] + 32.0 / 9.0 * k3[i]);
    hc_right_hand_side(s, t + 0.8 * h, z, k4);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + h * (19372.0 / 6561.0 * k1[i] - 25360.0 / 2187.0 * k2[i] + 64448.0 / 6561.0 * k3[i] -
                            212.0 / 729.0 * k4[i]);
    hc_right_hand_side(s, t + 8.0 / 9.0 * h, z, k5);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + h * (9017.0 / 3168.0 * k1[i] - 355.0 / 33.0 * k2[i] + 46732.0 / 5247.0 * k3[i] +
                            49.0 / 176.0 * k4[i] - 5103.0 / 18656.0 * k5[i]);
    hc_right_hand_side(s, t + h, z, k6);
    for (int i = 0; i < n; i++)
        x[i] = x0[i] + h * (35.0 / 384.0 * k1[i] + 500.0 / 1113.0 * k3[i] + 125.0 / 192.0 * k4[i] -
                            2187.0 / 6784.0 * k5[i] + 11.0 / 84.0 * k6[i]);
    hc_right_hand_side(s, t + h, x, k7);
    for (int i = 0; i < n; i++) {
        const double before = fabs(x0[i]), after = fabs(x[i]);
        const double error = 71.0 / 57600.0 * k1[i] - 71.0 / 16695.0 * k3[i] + 71.0 / 1920.0 * k4[i] -
                             17253.0 / 339200.0 * k5[i] + 22.0 / 525.0 * k6[i] - 1.0 / 40.0 * k7[i];
        z[i] = h * error / (absolute[i] + rtol * (before > after ? before : after));
    }
    return mean_square(s, z);
}

/* Bogacki and Shampine (1989), Applied Mathematics Letters 2: order 3, with the next step's first derivative in f */
static double step_bogacki_shampine(hc_solver *s, double h)
{
    const int n = s->n;
    const double rtol = s->rtol, t = s->t0;
    const double *restrict x0 = s->x0, *restrict k1 = s->f0, *restrict absolute = s->absolute;
    double *restrict k2 = s->k[0], *restrict k3 = s->k[1], *restrict k4 = s->f;
    double *restrict x = s->x, *restrict z = s->stage;

    for (int i = 0; i < n; i++)
        z[i] = x0[i] + 0.5 * h * k1[i];
    hc_right_hand_side(s, t + 0.5 * h, z, k2);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + 0.75 * h * k2[i];
    hc_right_hand_side(s, t + 0.75 * h, z, k3);
    for (int i = 0; i < n; i++)
        x[i] = x0[i] + h / 9.0 * (2.0 * k1[i] + 3.0 * k2[i] + 4.0 * k3[i]);
    hc_right_hand_side(s, t + h, x, k4);
    for (int i = 0; i < n; i++) {
        const double error = -5.0 * k1[i] + 6.0 * k2[i] + 8.0 * k3[i] - 9.0 * k4[i];
        z[i] = h / 72.0 * error / (absolute[i] + rtol * fabs(x[i]));
    }
    return mean_square(s, z);
}

/* leaves f to whoever needs it */
static void step_rk4(hc_solver *s, double h)
{
    const int n = s->n;
    const double t = s->t0;
    const double *restrict x0 = s->x0, *restrict k1 = s->f0;
    double *restrict k2 = s->k[0], *restrict k3 = s->k[1], *restrict k4 = s->k[2];
    double *restrict x = s->x, *restrict z = s->stage;

    for (int i = 0; i < n; i++)
        z[i] = x0[i] + 0.5 * h * k1[i];
    hc_right_hand_side(s, t + 0.5 * h, z, k2);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + 0.5 * h * k2[i];
    hc_right_hand_side(s, t + 0.5 * h, z, k3);
    for (int i = 0; i < n; i++)
        z[i] = x0[i] + h * k3[i];
    hc_right_hand_side(s, t + h, z, k4);
    for (int i = 0; i < n; i++)
        x[i] = x0[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]);
}

/* ---- inside a step: theta = 0 at its start, 1 at its end ---- */

/* Hermite's cubic; for Dormand-Prince with Shampine's quartic term (order 4) */
void hc_make_dense(hc_solver *s)
{
    const int n = s->n;
    const double h = s->length;
    const double *restrict x0 = s->x0, *restrict x = s->x, *restrict k1 = s->f0, *restrict k7 = s->f;
    const double *restrict k3 = s->k[1], *restrict k4 = s->k[2], *restrict k5 = s->k[3], *restrict k6 = s->k[4];
    double *restrict c0 = s->dense[0], *restrict c1 = s->dense[1], *restrict c2 = s->dense[2];
    double *restrict c3 = s->dense[3], *restrict c4 = s->dense[4];

    for (int i = 0; i < n; i++) {
        const double change = x[i] - x0[i], bend = h * k1[i] - change;
        c0[i] = x0[i];
        c1[i] = change;
        c2[i] = bend;
        c3[i] = change - h * k7[i] - bend;
    }
    if (s->cubic)
        memset(c4, 0, (size_t)n * sizeof *c4);
    else if (s->method == HC_DORMAND_PRINCE)
        for (int i = 0; i < n; i++)
            c4[i] = h * (-12715105075.0 / 11282082432.0 * k1[i] + 87487479700.0 / 32700410799.0 * k3[i] -
                         10690763975.0 / 1880347072.0 * k4[i] + 701980252875.0 / 199316789632.0 * k5[i] -
                         1453857185.0 / 822651844.0 * k6[i] + 69997945.0 / 29380423.0 * k7[i]);
    s->has_dense = 1;
}

void hc_interpolate(const hc_solver *s, double theta, double *restrict x)
{
    const int n = s->n;
    const double rest = 1.0 - theta;
    const double *restrict c0 = s->dense[0], *restrict c1 = s->dense[1], *restrict c2 = s->dense[2];
    const double *restrict c3 = s->dense[3], *restrict c4 = s->dense[4];
    for (int i = 0; i < n; i++)
        x[i] = c0[i] + theta * (c1[i] + rest * (c2[i] + theta * (c3[i] + rest * c4[i])));
}

const int *hc_solver_inside(hc_solver *s, double t, double *x)
{
    if (t >= s->t - (s->n_held > 0 ? hc_ticks_room(s->t) : 0.0) || s->length == 0.0) {
        memcpy(x, s->x, (size_t)(s->n + s->n_held) * sizeof *x);
        return s->mode;
    }
    if (!s->has_dense && s->f_open) { /* as it was before the ticks at the end of the step */
        memcpy(s->stage, s->x, (size_t)s->n * sizeof *x);
        hc_ticks_hold(s->model, s->stage, s->x0);
        hc_right_hand_side(s, s->t, s->stage, s->f);
        s->f_open = 0;
        s->fresh = !s->ticks.ticked;
    }
    if (!s->has_dense)
        hc_make_dense(s);
    hc_interpolate(s, (t - s->t0) / s->length, x);
    hc_ticks_hold(s->model, x, s->x0);
    return s->mode0;
}

/* ---- the length of a step ---- */

/* Hairer, Norsett, Wanner, II.4, "Starting step size" */
static double first_length(hc_solver *s)
{
    const int n = s->n;
    double *z = s->stage, *f1 = s->k[0];
    double size, slope, curve, h;
    for (int i = 0; i < n; i++)
        z[i] = s->x[i] / (s->absolute[i] + s->rtol * fabs(s->x[i]));
    size = sqrt(mean_square(s, z));
    for (int i = 0; i < n; i++)
        z[i] = s->f[i] / (s->absolute[i] + s->rtol * fabs(s->x[i]));
    slope = sqrt(mean_square(s, z));
    h = size < 1e-5 || slope < 1e-5 ? 1e-6 : 0.01 * size / slope;
    if (h > s->longest)
        h = s->longest;
    for (int i = 0; i < n; i++)
        z[i] = s->x[i] + h * s->f[i];
    hc_right_hand_side(s, s->t + h, z, f1);
    for (int i = 0; i < n; i++)
        z[i] = (f1[i] - s->f[i]) / (s->absolute[i] + s->rtol * fabs(s->x[i]));
    curve = sqrt(mean_square(s, z)) / h;
    if (!hc_is_finite(curve))
        return h;
    if (slope > curve)
        curve = slope;
    const double second = curve <= 1e-15 ? (h > 1e-3 ? 1e-3 * h : 1e-6) : pow(0.01 / curve, 0.2);
    h = 100.0 * h < second ? 100.0 * h : second;
    return h < s->longest ? h : s->longest;
}

/* A step to `stop` that is much shorter than the error asks for: half the work will do. Returns 0 if it does not. */
static int short_step(hc_solver *s, double stop)
{
    const double h = stop - s->t0;
    if (!s->short_steps || h > SHORT * s->h || s->log_error > SHORT_BEFORE)
        return 0;
    s->length = h;
    s->has_dense = 0;
    s->cubic = 1;
    if (step_bogacki_shampine(s, h) <= SHORT_ERROR && (s->n_friction == 0 || hc_look_for_events(s)))
        return 1;
    s->cubic = 0;
    s->counts[HC_REJECTED]++;
    return 0;
}

/* Adaptive: repeat until the error is within its bound. Returns with x, f, length and h set. */
static int choose_and_step(hc_solver *s, double stop)
{
    int rejections = 0, unseen = 0, finite = 1;
    for (;;) {
        const double rest = stop - s->t0;
        const int last = 1.01 * s->h >= rest && rest <= s->longest;
        const double h = last ? rest : s->h;
        if (!last && h <= 16.0 * DBL_EPSILON * fabs(s->t0) + 1e-100)
            return finite ? HC_STEP_TOO_SMALL : HC_NOT_FINITE;
        if (s->max_steps > 0 && s->steps >= s->max_steps)
            return HC_TOO_MANY_STEPS;
        s->steps++;
        const double error = step_dormand_prince(s, h); /* squared */
        finite = hc_is_finite(error);
        s->length = h;
        s->has_dense = 0;
        if (error <= 1.0) {
            if (s->n_friction == 0 || hc_look_for_events(s) || unseen == 3) {
                const double logarithm = log(error > 1e-8 ? error : 1e-8);
                double factor = 0.9 * exp(-0.085 * logarithm + 0.02 * s->log_error);
                if (factor > 10.0)
                    factor = 10.0;
                if (rejections > 0 && factor > 1.0)
                    factor = 1.0;
                if (factor < 0.2)
                    factor = 0.2;
                s->log_error = logarithm;
                if (factor < 1.0 || factor * h > s->h || h >= s->h) /* a step cut short by `stop` shortens no other */
                    s->h = factor * h;
                if (s->h > s->longest)
                    s->h = s->longest;
                return HC_OK;
            }
            unseen++;
            s->h = 0.25 * h;
        } else {
            const double factor = finite ? 0.9 * exp(-0.085 * log(error)) : 0.2;
            s->h = h * (factor > 0.2 ? factor : 0.2);
        }
        rejections++;
        s->counts[HC_REJECTED]++;
    }
}

static int fixed_step(hc_solver *s, double stop)
{
    const double rest = stop - s->t0;
    if (s->max_steps > 0 && s->steps >= s->max_steps)
        return HC_TOO_MANY_STEPS;
    s->steps++;
    s->length = (1.0 + 1e-9) * s->longest >= rest ? rest : s->longest;
    s->has_dense = 0;
    step_rk4(s, s->length);
    if (!all_finite(s->n, s->x))
        return HC_NOT_FINITE;
    if (s->n_friction > 0) {
        hc_right_hand_side(s, s->t0 + s->length, s->x, s->f);
        if (!all_finite(s->n, s->f))
            return HC_NOT_FINITE;
        hc_look_for_events(s);
    }
    return HC_OK;
}

/* From a switch to the next the model's conditions on time stay as they are; the bounds leave room for rounding. */
static void look_for_switch(hc_solver *s)
{
    const double room = 8.0 * DBL_EPSILON;
    double next = DBL_MAX;
    s->earliest = -DBL_MAX;
    if (s->model->next_switch) {
        next = s->model->next_switch(s->t + room * fabs(s->t), s->p);
        if (next < DBL_MAX || s->next_switch < DBL_MAX)
            s->earliest = s->t + room * fabs(s->t);
    }
    s->next_switch = next;
    s->latest = next < DBL_MAX ? next - room * fabs(next) : DBL_MAX;
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

/* What follows when held states have jumped. */
static int after_ticks(hc_solver *s)
{
    s->fresh = 0;
    if (!all_finite(s->n_held, s->x + s->n))
        return HC_NOT_FINITE;
    return find_modes(s);
}

static int pass_ticks(hc_solver *s)
{
    s->ticks.ticked = 0;
    if (!hc_ticks_due(&s->ticks, s->t) || s->t >= s->quiet_from)
        return HC_OK;
    hc_ticks_take(&s->ticks, s->t, s->x, s->u, s->p, s->mode);
    return after_ticks(s);
}

/* Between ticks nothing moves. */
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
    if (s->t >= s->next_switch) { /* start anew beyond it */
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
        if (!all_finite(s->n, s->f))
            return HC_NOT_FINITE;
        s->fresh = 1;
    }
    if (s->h == 0.0 && s->method == HC_DORMAND_PRINCE)
        s->h = first_length(s);
    s->t0 = s->t;
    swap(&s->x, &s->x0);
    swap(&s->f, &s->f0);
    hc_ticks_hold(s->model, s->x, s->x0);
    s->cubic = 0;
    if (short_step(s, stop))
        status = HC_OK;
    else
        status = s->method == HC_DORMAND_PRINCE ? choose_and_step(s, stop) : fixed_step(s, stop);
    if (status != HC_OK) { /* back to the last good time */
        swap(&s->x, &s->x0);
        swap(&s->f, &s->f0);
        s->length = 0.0;
        return status;
    }
    s->counts[HC_ACCEPTED]++;
    s->t = s->length == stop - s->t0 ? stop : s->t0 + s->length;
    s->fresh = s->method == HC_DORMAND_PRINCE || s->n_friction > 0;
    s->f_open = !s->fresh;
    if (s->n_friction > 0) {
        memcpy(s->mode0, s->mode, (size_t)s->n_friction * sizeof *s->mode);
        status = hc_pass_events(s);
    }
    return status == HC_OK ? pass_ticks(s) : status;
}

/* ---- what users call ---- */

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

/* ---- all that it knows, as doubles ---- */

/* Copy n numbers to the buffer, or from it, and go on behind them. */
static void copy(double *own, int n, double **buffer, int load)
{
    memcpy(load ? own : *buffer, load ? *buffer : own, (size_t)n * sizeof *own);
    *buffer += n;
}

enum { N_NUMBERS = 13, N_ARRAYS = 13, N_WHOLE = 8 };

/* Whole numbers below 2^53 are exact doubles; work space is left out. */
static void transfer(hc_solver *s, double *buffer, int load)
{
    double *const numbers[N_NUMBERS] = {&s->rtol,        &s->longest, &s->t,      &s->earliest, &s->latest,
                                        &s->next_switch, &s->t0,      &s->length, &s->h,        &s->log_error,
                                        &s->t_event,     &s->ticks.next, &s->ticks.at};
    double *const arrays[N_ARRAYS] = {s->f, s->f0, s->absolute, s->k[0], s->k[1], s->k[2], s->k[3], s->k[4],
                                      s->dense[0], s->dense[1], s->dense[2], s->dense[3], s->dense[4]};
    int *const whole[N_WHOLE] = {&s->method, &s->fresh, &s->f_open, &s->has_dense, &s->events_here,
                                 &s->cubic, &s->started, &s->ticks.ticked};
    const int n_all = s->n + s->n_held;
    double steps = (double)s->steps;
    for (int i = 0; i < N_NUMBERS; i++)
        copy(numbers[i], 1, &buffer, load);
    for (int i = 0; i < N_ARRAYS; i++)
        copy(arrays[i], s->n, &buffer, load);
    copy(s->x, n_all, &buffer, load);
    copy(s->x0, n_all, &buffer, load);
    copy(s->u, s->model->n_inputs, &buffer, load);
    copy(s->p, s->model->n_parameters, &buffer, load);
    copy(s->ticks.due, (int)hc_ticks_size(s->model), &buffer, load);
    copy(&steps, 1, &buffer, load);
    s->steps = (long)steps;
    for (int i = 0; i < N_WHOLE; i++) {
        double number = *whole[i];
        copy(&number, 1, &buffer, load);
        *whole[i] = (int)number;
    }
    for (int k = 0; k < 4; k++) {
        double count = (double)s->counts[k];
        copy(&count, 1, &buffer, load);
        s->counts[k] = (long)count;
    }
    for (int k = 0; k < 2 * s->n_friction; k++) { /* mode, then mode0 */
        double mode = s->mode[k];
        copy(&mode, 1, &buffer, load);
        s->mode[k] = (int)mode;
    }
}

size_t hc_solver_size(const hc_solver *s)
{
    const int n_all = s->n + s->n_held;
    return (size_t)(N_NUMBERS + N_ARRAYS * s->n + 2 * n_all + s->model->n_inputs + s->model->n_parameters + 1 + N_WHOLE +
                    4 + 2 * s->n_friction) +
           hc_ticks_size(s->model);
}

void hc_solver_save(const hc_solver *s, double *into)
{
    transfer((hc_solver *)s, into, 0); /* which then only reads */
}

void hc_solver_load(hc_solver *s, const double *from)
{
    transfer(s, (double *)from, 1);
}
