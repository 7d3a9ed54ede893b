/* Step size: as large as the local error allows, or fixed.
 *
 * Step control: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., II.4.
 */
#include "hc_methods.h"

#define SHORT 0.5           /* fraction of the next step size; applies if the last error was below: */
#define SHORT_BEFORE (-12.0) /* logarithm, squared */
#define SHORT_ERROR 0.01    /* squared; error allowed for a short step */

/* Hairer, Norsett, Wanner, II.4, "Starting step size" */
double hc_first_length(hc_solver *s)
{
    const int n = s->n;
    double *z = s->stage, *f1 = s->k[0];
    double size, slope, curve, h;
    for (int i = 0; i < n; i++)
        z[i] = s->x[i] / (s->absolute[i] + s->rtol * fabs(s->x[i]));
    size = sqrt(hc_mean_square(s, z));
    for (int i = 0; i < n; i++)
        z[i] = s->f[i] / (s->absolute[i] + s->rtol * fabs(s->x[i]));
    slope = sqrt(hc_mean_square(s, z));
    h = size < 1e-5 || slope < 1e-5 ? 1e-6 : 0.01 * size / slope;
    if (h > s->longest)
        h = s->longest;
    for (int i = 0; i < n; i++)
        z[i] = s->x[i] + h * s->f[i];
    hc_right_hand_side(s, s->t + h, z, f1);
    for (int i = 0; i < n; i++)
        z[i] = (f1[i] - s->f[i]) / (s->absolute[i] + s->rtol * fabs(s->x[i]));
    curve = sqrt(hc_mean_square(s, z)) / h;
    if (!hc_is_finite(curve))
        return h;
    if (slope > curve)
        curve = slope;
    const double root = s->method == HC_DOP853 ? 1.0 / 8.0 : 1.0 / 5.0;
    const double second = curve <= 1e-15 ? (h > 1e-3 ? 1e-3 * h : 1e-6) : pow(0.01 / curve, root);
    h = 100.0 * h < second ? 100.0 * h : second;
    return h < s->longest ? h : s->longest;
}

/* Try a step of order 3, at half the work, if `stop` is much nearer than the error requires. Returns 0 if its error is
 * too large. */
static int short_step(hc_solver *s, double stop)
{
    const double h = stop - s->t0;
    if (!s->short_steps || h > SHORT * s->h || s->log_error > SHORT_BEFORE)
        return 0;
    s->length = h;
    s->has_dense = 0;
    s->cubic = 1;
    if (hc_step_bogacki_shampine(s, h) <= SHORT_ERROR && (s->n_friction == 0 || hc_look_for_events(s)))
        return 1;
    s->cubic = 0;
    s->counts[HC_REJECTED]++;
    return 0;
}

/* Length of the next step over this one, from squared errors: 0.9 (err^2)^-power (last err^2)^memory, at most 10 */
typedef struct {
    double (*step)(hc_solver *s, double h);
    double power, memory, least; /* least: squared error below which the factor is 10 at most */
} hc_pair;

static const hc_pair dormand_prince = {hc_step_dormand_prince, 0.085, 0.02, 1e-8};
static const hc_pair dop853 = {hc_step_dop853, 0.0625, 0.0, 1e-17};

/* Adaptive: repeat until the error is within its bound. Returns with x, f, length and h set. */
static int adaptive_step(hc_solver *s, double stop, const hc_pair *pair)
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
        const double error = pair->step(s, h); /* squared */
        finite = hc_is_finite(error);
        s->length = h;
        s->has_dense = 0;
        if (error <= 1.0) {
            if (s->n_friction == 0 || hc_look_for_events(s) || unseen == 3) {
                const double logarithm = log(error > pair->least ? error : pair->least);
                double factor = 0.9 * exp(-pair->power * logarithm + pair->memory * s->log_error);
                if (factor > 10.0)
                    factor = 10.0;
                if (rejections > 0 && factor > 1.0)
                    factor = 1.0;
                if (factor < 0.2)
                    factor = 0.2;
                s->log_error = logarithm;
                if (factor < 1.0 || factor * h > s->h || h >= s->h) /* `stop` does not reduce the next step size */
                    s->h = factor * h;
                if (s->h > s->longest)
                    s->h = s->longest;
                return HC_OK;
            }
            unseen++;
            s->h = 0.25 * h;
        } else {
            const double factor = finite ? 0.9 * exp(-pair->power * log(error)) : 0.2;
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
    hc_step_rk4(s);
    if (!hc_all_finite(s->n, s->x))
        return HC_NOT_FINITE;
    if (s->n_friction > 0) {
        hc_right_hand_side(s, s->t0 + s->length, s->x, s->f);
        if (!hc_all_finite(s->n, s->f))
            return HC_NOT_FINITE;
        hc_look_for_events(s);
    }
    return HC_OK;
}

int hc_choose_and_step(hc_solver *s, double stop)
{
    if (short_step(s, stop))
        return HC_OK;
    if (s->method == HC_RK4)
        return fixed_step(s, stop);
    return adaptive_step(s, stop, s->method == HC_DOP853 ? &dop853 : &dormand_prince);
}
