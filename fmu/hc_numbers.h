/* Private to the runtime: finite numbers, and equality of times. */
#ifndef HC_NUMBERS_H
#define HC_NUMBERS_H

#include <float.h>
#include <math.h>

static inline int hc_is_finite(double value)
{
    return fabs(value) <= DBL_MAX;
}

/* Times closer than this are equal: grids of times have rounding errors. */
static inline double hc_room(double t)
{
    return 8.0 * DBL_EPSILON * fabs(t);
}

#endif
