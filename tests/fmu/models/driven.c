/* Speeds under forces that vary in time, each with dry friction: v0' = sin t - p0 sgn v0, v1' = p1 t - p2 sgn v1,
 * v2' = p3 sin(p4 t) - p5 sgn v2. Outputs: the speeds and the modes. */
#include "hc_model.h"

#include <math.h>

static const int friction_state[] = {0, 1, 2};

static void friction(double t, const double *x, const double *u, const double *p, const int *mode, double *a,
                     double *b)
{
    (void)x, (void)u, (void)mode;
    a[0] = sin(t);
    b[0] = -p[0];
    a[1] = p[1] * t;
    b[1] = -p[2];
    a[2] = p[3] * sin(p[4] * t);
    b[2] = -p[5];
}

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    double a[3], b[3];
    friction(t, x, u, p, mode, a, b);
    for (int k = 0; k < 3; k++)
        dx[k] = mode[k] ? a[k] + b[k] * mode[k] : 0.0;
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p;
    for (int k = 0; k < 3; k++) {
        y[k] = x[k];
        y[3 + k] = mode[k];
    }
}

const hc_model_type hc_model = {3, 0, 6, 6, 3, friction_state, derivatives, outputs, friction, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};
