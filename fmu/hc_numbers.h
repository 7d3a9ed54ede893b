/* Private to the runtime: what a number is, and how near two times are one. */
#ifndef HC_NUMBERS_H
#define HC_NUMBERS_H

#include <float.h>
#include <math.h>

static inline int hc_is_finite(double value)
{
    return fabs(value) <= DBL_MAX;
}

/* Times that are nearer to each other than this are one: grids of times are computed with rounding. */
static inline double hc_room(double t)
{
    return 8.0 * DBL_EPSILON * fabs(t);
}

#endif
