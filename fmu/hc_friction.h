/* Dry friction: which velocities stick and which slip. */
#ifndef HC_FRICTION_H
#define HC_FRICTION_H

#include "hc_model.h"

/* |a| - |b|, the force beyond what sticking can hold: positive if a velocity at rest breaks away. */
double hc_friction_excess(double a, double b);

/* Modes of all velocities that are exactly zero, one change at a time, until they agree with the forces; the modes of
 * the others stay. `a` and `b` are work space, n_friction each. Returns HC_OK or HC_NOT_FINITE. */
int hc_friction_modes(const hc_model_type *model, double t, const double *x, const double *u, const double *p, int *mode,
                      double *a, double *b);

#endif
