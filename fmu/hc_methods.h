/* Private to the runtime: the methods of the solver, and the step control that uses them. */
#ifndef HC_METHODS_H
#define HC_METHODS_H

#include "hc_solver_internal.h"

/* Order 5. Returns the mean square of the local error over its bound. */
double hc_step_dormand_prince(hc_solver *s, double h);

/* Order 8; needs n_k = HC_MOST_STAGES and n_dense = HC_MOST_DENSE. Returns the same. */
double hc_step_dop853(hc_solver *s, double h);

/* Its last four coefficients of dense output, from three more evaluations. */
void hc_dense_dop853(hc_solver *s);

/* Order 3, with the next step's first derivative in f. Returns the same. */
double hc_step_bogacki_shampine(hc_solver *s, double h);

/* Order 4, over s->length. Does not compute f. */
void hc_step_rk4(hc_solver *s);

/* Size of the first step. */
double hc_first_length(hc_solver *s);

/* Take a step of suitable size to x, f, at most to `stop`, with the solver's method. Returns a status. */
int hc_choose_and_step(hc_solver *s, double stop);

/* mean square, in four sums side by side */
static inline double hc_mean_square(const hc_solver *s, const double *restrict e)
{
    const int n = s->n;
    double s0 = 0.0, s1 = 0.0, s2 = 0.0, s3 = 0.0;
    int i = 0;
    for (; i + 4 <= n; i += 4) {
        s0 += e[i] * e[i];
        s1 += e[i + 1] * e[i + 1];
        s2 += e[i + 2] * e[i + 2];
        s3 += e[i + 3] * e[i + 3];
    }
    for (; i < n; i++)
        s0 += e[i] * e[i];
    return ((s0 + s1) + (s2 + s3)) / s->n_mean;
}

static inline int hc_all_finite(int n, const double *restrict value)
{
    double zero = 0.0;
    for (int i = 0; i < n; i++)
        zero += 0.0 * value[i];
    return zero == 0.0;
}

#endif
