/* Systems without dry friction, side by side: a harmonic oscillator (x0, x1), Van der Pol's with damping p0 (x2, x3),
 * a mass with friction tanh(v/p1) under sin t (x4), and x5' = sqrt(p2 - t), which has no value after t = p2. */
#include "hc_model.h"

#include <math.h>

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    (void)u, (void)mode;
    dx[0] = x[1];
    dx[1] = -x[0];
    dx[2] = x[3];
    dx[3] = p[0] * (1.0 - x[2] * x[2]) * x[3] - x[2];
    dx[4] = sin(t) - 0.7 * tanh(x[4] / p[1]);
    dx[5] = sqrt(p[2] - t);
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p, (void)mode;
    for (int i = 0; i < 6; i++)
        y[i] = x[i];
}

const hc_model_type hc_model = {6, 0, 3, 6, 0, 0, derivatives, outputs, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};
