/* One step of each method, from x0, f0 over h to x, f.
 *
 * Dormand and Prince (1980) in Hairer, Norsett, Wanner, "Solving Ordinary Differential Equations I", 2nd ed., II.5;
 * Bogacki and Shampine (1989), Applied Mathematics Letters 2; Runge-Kutta as in hc_rk4.h.
 */
#include "hc_methods.h"

#include "hc_rk4.h"

double hc_step_dormand_prince(hc_solver *s, double h)
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
    return hc_mean_square(s, z);
}

double hc_step_bogacki_shampine(hc_solver *s, double h)
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
    return hc_mean_square(s, z);
}

static void slope(void *system, double part, double *x, double *dx)
{
    hc_solver *s = system;
    hc_right_hand_side(s, s->t0 + part * s->length, x, dx);
}

void hc_step_rk4(hc_solver *s)
{
    hc_rk4_step(s->n, 1, slope, s, &s->length, s->x0, s->f0, s->k[0], s->k[1], s->k[2], s->stage, s->x);
}
