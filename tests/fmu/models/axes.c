/* Three masses in a row of springs, each on a rough floor; the first is shaken. x0..2 positions, x3..5 speeds.
 * Parameters: stiffness, force, angular frequency, three coefficients of friction. */
#include "hc_model.h"

#include <math.h>

static const int friction_state[] = {3, 4, 5};
static const double mass[] = {1.0, 0.6, 1.7};

static void forces(double t, const double *x, const double *p, double *a)
{
    const double first = p[0] * (x[1] - x[0]), second = p[0] * (x[2] - x[1]);
    a[0] = (p[1] * sin(p[2] * t) + first - p[0] * x[0]) / mass[0];
    a[1] = (second - first) / mass[1];
    a[2] = -second / mass[2];
}

static void friction(double t, const double *x, const double *u, const double *p, const int *mode, double *a,
                     double *b)
{
    (void)u, (void)mode;
    forces(t, x, p, a);
    for (int k = 0; k < 3; k++)
        b[k] = -p[3 + k] / mass[k];
}

static void derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    double a[3], b[3];
    friction(t, x, u, p, mode, a, b);
    for (int k = 0; k < 3; k++) {
        dx[k] = x[3 + k];
        dx[3 + k] = mode[k] ? a[k] + b[k] * mode[k] : 0.0;
    }
}

static void outputs(double t, const double *x, const double *u, const double *p, const int *mode, double *y)
{
    (void)t, (void)u, (void)p;
    for (int i = 0; i < 6; i++)
        y[i] = x[i];
    for (int k = 0; k < 3; k++)
        y[6 + k] = mode[k];
}

const hc_model_type hc_model = {6, 0, 6, 9, 3, friction_state, derivatives, outputs, friction, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0};

/* The same by Moreau's time stepping, which knows neither modes nor events (error proportional to the step): states
 * after every `every` steps. */
void moreau(double *x, const double *p, double step, long n_steps, long every, double *states)
{
    for (long i = 0; i < n_steps; i++) {
        double a[3];
        for (int k = 0; k < 3; k++)
            x[k] += 0.5 * step * x[3 + k];
        forces((i + 0.5) * step, x, p, a);
        for (int k = 0; k < 3; k++) {
            const double free = x[3 + k] + step * a[k], most = step * p[3 + k] / mass[k];
            x[3 + k] = free > most ? free - most : free < -most ? free + most : 0.0;
            x[k] += 0.5 * step * x[3 + k];
        }
        if ((i + 1) % every == 0)
            for (int j = 0; j < 6; j++)
                *states++ = x[j];
    }
}
