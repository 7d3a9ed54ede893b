/* A simulation step by step, with inputs set between steps: hardware in the loop, reinforcement learning, a pilot. One
 * runner belongs to one thread. */
#ifndef HC_RUNNER_H
#define HC_RUNNER_H

#include "hc_solver.h"

#define HC_INPUT_NOT_FINITE (-1) /* in addition to the statuses of hc_solver.h; nothing is changed */

typedef struct hc_runner hc_runner;

/* NULL if there is no memory. Every call that changes the run writes the n_outputs outputs to `y`. */
hc_runner *hc_runner_new(const hc_model_type *model, const hc_options *options, double *y);
void hc_runner_free(hc_runner *runner);

/* Start at time t; ticks due at t are executed. */
int hc_runner_begin(hc_runner *runner, double t, const double *x, const double *u, const double *p);

/* Set inputs to u and integrate to time `until`, including the ticks due then. If `until` is the current time, only the
 * inputs are set. On an error the runner stays at the time it reached. */
int hc_runner_step(hc_runner *runner, double until, const double *u);

/* Set the states whose `given` is not 0, and parameters (or NULL). Ticks of this time are repeated; give the states
 * that they set as they were before the ticks. */
int hc_runner_jump(hc_runner *runner, const double *x, const int *given, const double *p);

double hc_runner_time(const hc_runner *runner);
void hc_runner_states(const hc_runner *runner, double *x);

/* The whole state as hc_runner_size numbers; a runner of the same model that loads it continues bit for bit. */
long hc_runner_size(const hc_runner *runner);
void hc_runner_save(const hc_runner *runner, double *into);
void hc_runner_load(hc_runner *runner, const double *from);

#endif
