/* Dense output within a step: theta = 0 at its start, 1 at its end.
 *
 * Hermite's cubic; for Dormand-Prince 5(4) with Shampine's quartic term, of order 4, for 8(5,3) with four terms, of order
 * 7: Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., II.6.
 */
#include "hc_methods.h"

#include <string.h>

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
        for (int j = 4; j < s->n_dense; j++)
            memset(s->dense[j], 0, (size_t)n * sizeof *c4);
    else if (s->method == HC_DOP853)
        hc_dense_dop853(s);
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
    for (int i = 0; i < n; i++)
        x[i] = hc_interpolate_one(s, i, theta);
}

const int *hc_solver_inside(hc_solver *s, double t, double *x)
{
    if (t >= s->t - (s->n_held > 0 ? hc_room(s->t) : 0.0) || s->length == 0.0) {
        memcpy(x, s->x, (size_t)(s->n + s->n_held) * sizeof *x);
        return s->mode;
    }
    if (!s->has_dense && s->f_open) { /* value before the ticks at the end of the step */
        memcpy(s->stage, s->x, (size_t)s->n * sizeof *x);
        hc_ticks_hold(s->model, s->stage, s->x0);
        hc_right_hand_side(s, s->t, s->stage, s->f);
        s->f_open = 0;
        s->fresh = !s->ticks.ticked;
    }
    if (!s->has_dense)
        hc_make_dense(s);
    hc_interpolate(s, (t - s->t0) / s->length, x);
    hc_ticks_hold(s->model, x, s->ticks.ticked && hc_ticks_same(&s->ticks, s->ticks.at, t) ? s->x : s->x0);
    return s->mode0;
}
