/* Two velocities on one rigid link, so that the friction of one acts on the other: v' = M^-1 (u - F),
 * M^-1 = [1 q; q 1], |q| < 1, F[k] = c[k] s[k]. Where the other axis sticks, its F is what holds it still.
 * Inputs u0, u1; parameters q, c0, c1; outputs the speeds and the modes. */
#include "hc_model.h"

static const int friction_state[] = {0, 1};

static void friction(double t, const double *x, const double *u, const double *p, const int *mode, double *a,
                     double *b)
{
    const double q = p[0];
    (void)t, (void)x;
    for (int k = 0; k < 2; k++) {
        const int j = 1 - k;
        a[k] = mode[j] ? u[k] + q * (u[j] - p[1 + j] * mode[j]) : (1.0 - q * q) * u[k];
        b[k] = mode[j] ? -p[1 + k] : -(1.0 - q * q) * p[1 + k];
    }
}

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    double a[2], b[2];
    friction(t, x, u, p, mode, a, b);
    for (int k = 0; k < 2; k++)
        dx[k] = mode[k] ? a[k] + b[k] * mode[k] : 0.0;
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p;
    for (int k = 0; k < 2; k++) {
        y[k] = x[k];
        y[2 + k] = mode[k];
    }
}

const hc_model_type hc_model = {2, 2, 3, 4, 2, friction_state, derivatives, outputs, friction, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};
