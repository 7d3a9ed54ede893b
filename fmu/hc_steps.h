/* Private to the runtime: single steps of the solver, which a fine grid of results does not shorten. */
#ifndef HC_STEPS_H
#define HC_STEPS_H

#include "hc_solver.h"

/* Reset step size and step count, so that results do not depend on earlier calls. */
void hc_solver_restart(hc_solver *solver);

/* Take one step of the solver's own size, at most to `stop`; an event ends it early. */
int hc_solver_step(hc_solver *solver, double stop);

/* States at a time within the last step, into x; returns the friction modes that hold there. */
const int *hc_solver_inside(hc_solver *solver, double t, double *x);

#endif
