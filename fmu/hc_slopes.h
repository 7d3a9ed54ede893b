/* Derivatives and their partial derivatives for HC_LANES points at once. */
#ifndef HC_SLOPES_H
#define HC_SLOPES_H

#include "hc_lanes.h"

typedef struct {
    int n;                              /* partial derivatives that are not identically zero */
    const unsigned short *row, *column; /* of each: a derivative; a state or, behind the states, a parameter */
    /* As hc_lanes_function; partial k of lane l is at value[k * HC_LANES + l]. */
    void (*function)(const double *t, const double *x, const double *u, const double *p, const double *mode, double *dx,
                     double *value);
} hc_slopes;

/* Defined by a generated slopes.c; the function is NULL if vectors are no faster. */
extern const hc_slopes hc_model_slopes;

#endif
