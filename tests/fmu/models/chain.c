/* N states in a damped chain pulled to the input, for measuring the runtime: build with -DN=... */
#include "hc_model.h"

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    (void)t, (void)mode;
    dx[0] = p[0] * (u[0] - x[0]);
    for (int i = 1; i < N; i++)
        dx[i] = p[0] * (x[i - 1] - x[i]);
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p, (void)mode;
    y[0] = x[N - 1];
    y[1] = x[0];
}

const hc_model_type hc_model = {N, 1, 1, 2, 0, 0, derivatives, outputs, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};
