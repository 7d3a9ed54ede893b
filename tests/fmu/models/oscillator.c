/* A mass on a spring with dry friction: x' = v, v' = u - w^2 x - c sgn v. Parameters w, c; outputs x, v. */
#include "hc_model.h"

static const int friction_state[] = {1};

static void friction(double t, const double *x, const double *u, const double *p, const int *mode, double *a,
                     double *b)
{
    (void)t, (void)mode;
    a[0] = u[0] - p[0] * p[0] * x[0];
    b[0] = -p[1];
}

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    double a, b;
    friction(t, x, u, p, mode, &a, &b);
    dx[0] = x[1];
    dx[1] = mode[0] ? a + b * mode[0] : 0.0;
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p, (void)mode;
    y[0] = x[0];
    y[1] = x[1];
}

const hc_model_type hc_model = {2, 1, 2, 2, 1, friction_state, derivatives, outputs, friction, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};
