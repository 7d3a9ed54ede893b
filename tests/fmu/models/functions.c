/* The functions of hc_math.h over arrays. */
#include "hc_math.h"

void values(int which, long n, const double *x, double *y)
{
    for (long i = 0; i < n; i++)
        y[i] = which == 0 ? hc_sin(x[i]) : which == 1 ? hc_cos(x[i]) : hc_tanh(x[i]);
}
