/* Private to the runtime: single steps of the solver, so that a fine grid of results does not shorten them. */
#ifndef HC_STEPS_H
#define HC_STEPS_H

#include "hc_solver.h"

/* Forget the step size and the count of steps: what follows does not depend on what was done before. */
void hc_solver_restart(hc_solver *solver);

/* Take one step of the solver's own size, never past `stop`; it ends early at an event. */
int hc_solver_step(hc_solver *solver, double stop);

/* States at a time within the last step, into x; returns the friction modes that hold there. */
const int *hc_solver_inside(hc_solver *solver, double t, double *x);

#endif
