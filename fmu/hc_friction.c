/* See hc_friction.h. */
#include "hc_friction.h"

#include <float.h>
#include <math.h>

#include "hc_solver.h"

#define BREAKAWAY 1e-12    /* relative excess of |a| over |b| at breakaway: fixes the direction of slip */

double hc_friction_excess(double a, double b)
{
    return fabs(a) - fabs(b) * (1.0 + BREAKAWAY);
}

int hc_friction_modes(const hc_model_type *model, double t, const double *x, const double *u, const double *p, int *mode,
                      double *a, double *b)
{
    const int m = model->n_friction;
    int k = 0;
    while (k < m && x[model->friction_state[k]] != 0.0)
        k++;
    if (k == m) /* none at rest */
        return HC_OK;
    k = 0;
    for (int changes = 0; k < m && changes < 4 * m + 4; changes++) {
        model->friction(t, x, u, p, mode, a, b);
        for (k = 0; k < m; k++) {
            if (x[model->friction_state[k]] != 0.0)
                continue;
            if (!(fabs(a[k]) <= DBL_MAX) || !(fabs(b[k]) <= DBL_MAX))
                return HC_NOT_FINITE;
            const int holds = b[k] != 0.0 && hc_friction_excess(a[k], b[k]) <= 0.0;
            const int found = holds ? 0 : a[k] < 0.0 ? -1 : 1;
            if (found != mode[k]) {
                mode[k] = found;
                break;
            }
        }
    }
    return HC_OK;
}
