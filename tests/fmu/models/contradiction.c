/* A model at odds with itself: its friction says that the velocity must break away, its derivative brings it back. */
#include "hc_model.h"

static const int friction_state[] = {0};

static void friction(double t, const double *x, const double *u, const double *p, const int *mode, double *a,
                     double *b)
{
    (void)t, (void)x, (void)u, (void)p, (void)mode;
    a[0] = 2.0;
    b[0] = -1.0;
}

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    (void)t, (void)x, (void)u, (void)p;
    dx[0] = -mode[0];
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p, (void)mode;
    y[0] = x[0];
}

const hc_model_type hc_model = {1, 0, 0, 1, 1, friction_state, derivatives, outputs, friction, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};
