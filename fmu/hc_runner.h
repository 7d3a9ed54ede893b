/* A run step by step, for whoever sends inputs as it goes: hardware in the loop, a learner, a pilot. One runner
 * belongs to one thread. */
#ifndef HC_RUNNER_H
#define HC_RUNNER_H

#include "hc_solver.h"

#define HC_INPUT_NOT_FINITE (-1) /* beside the statuses of hc_solver.h; nothing has changed then */

typedef struct hc_runner hc_runner;

/* NULL if there is no memory. `y` gets the outputs, n_outputs numbers, at every call that changes the run. */
hc_runner *hc_runner_new(const hc_model_type *model, const hc_options *options, double *y);
void hc_runner_free(hc_runner *runner);

/* Begin at time t; ticks due then are taken. */
int hc_runner_begin(hc_runner *runner, double t, const double *x, const double *u, const double *p);

/* Let inputs jump to u, where they differ, and go to time `until`, through the ticks due then. Where `until` is now
 * they only jump. On an error the runner stays at the time it reached. */
int hc_runner_step(hc_runner *runner, double until, const double *u);

/* Let states whose `given` is not 0 and parameters (or NULL) jump; ticks taken at this time are taken again: what
 * they set is given as it was before them. */
int hc_runner_jump(hc_runner *runner, const double *x, const int *given, const double *p);

double hc_runner_time(const hc_runner *runner);
void hc_runner_states(const hc_runner *runner, double *x);

/* All that a runner knows, as hc_runner_size numbers: a runner of the same model that loads them goes on to the bit. */
long hc_runner_size(const hc_runner *runner);
void hc_runner_save(const hc_runner *runner, double *into);
void hc_runner_load(hc_runner *runner, const double *from);

#endif
