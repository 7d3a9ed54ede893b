/* See hc_follow.h. */
#include "hc_follow.h"

#include <math.h>
#include <stdlib.h>

/* (exp(a) - 1) / a, kept within what a double can hold. */
static double grown(double a)
{
    a = fmax(-700.0, fmin(50.0, a));
    return fabs(a) > 1e-8 ? expm1(a) / a : 1.0;
}

int hc_follow_run(const hc_follow *follow, hc_follow_rates rates, long from, long to)
{
    const hc_follow *f = follow;
    const int q = f->n_followers;
    double *x = calloc((size_t)(f->n_states + f->n_inputs + 3 * q + 1), sizeof *x);
    double *u, *z, *dx;
    if (!x)
        return 1;
    u = x + f->n_states;
    z = u + f->n_inputs;
    dx = z + q;
    for (long w = from; w < to; w++) {
        for (int j = 0; j < q; j++)
            z[j] = f->values[j * (f->steps + 1) * f->windows + w] = 0.0;
        for (long k = 0; k < f->steps; k++) {
            const long at = k * f->windows + w, all = f->steps * f->windows;
            const double h = f->step[at];
            for (int i = 0; i < f->n_states; i++)
                x[i] = f->states[i * all + at];
            for (int i = 0; i < f->n_inputs; i++)
                u[i] = f->inputs[i * all + at];
            for (int j = 0; j < q; j++)
                x[f->followers[j]] = z[j];
            rates(f->time[at], x, u, f->parameters, NULL, dx);
            for (int j = 0; j < q; j++) {
                z[j] += h * dx[j] * grown(h * dx[q + j]);
                f->values[(j * (f->steps + 1) + k + 1) * f->windows + w] = z[j];
            }
        }
    }
    free(x);
    return 0;
}
