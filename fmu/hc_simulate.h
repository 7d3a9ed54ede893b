/* Simulations and sweeps on one thread: the exports of the shared library of a compiled Block. */
#ifndef HC_SIMULATE_H
#define HC_SIMULATE_H

#include "hc_lanes.h"
#include "hc_solver.h"

/* Figures of merit of each output, in this order. */
enum { HC_FINAL = 0, HC_MAX = 1, HC_MIN = 2, HC_RMS = 3, HC_SETTLING = 4, HC_N_FIGURES = 5 };

/* A model that is a part of a larger system, whose other states stay zero: state i is state place[i] of n_all. */
typedef struct {
    int n_all;
    const int *place;
} hc_part;

/* Change states x of time t to those of time `until`. Ticks at t are executed, those at `until` are not: the next call
 * executes them. If `until` equals t, only the ticks are executed. */
int hc_advance(const hc_model_type *model, const hc_options *options, double t, double until, double *x,
               const double *u, const double *p);

/* Simulate over a grid of times; inputs `u` (n_times rows of n_inputs, or NULL if the model has none) hold from one
 * row to the next. States go to `states` (n_times x n_states) and outputs to `outputs` (n_times x n_outputs), either may be
 * NULL. `x` holds the initial states and, afterwards, the last. On an error, `reached` tells the time. */
int hc_simulate(const hc_model_type *model, const hc_options *options, const double *times, long n_times,
                double *x, const double *u, const double *p, double *states, double *outputs, double *reached);

/* The same for a part (or NULL): x and the rows of `states` are those of the larger system, and a step is as long as
 * for all of it. */
int hc_simulate_part(const hc_model_type *model, const hc_part *part, const hc_options *options, const double *times,
                     long n_times, double *x, const double *u, const double *p, double *states, double *outputs,
                     double *reached);

/* Simulate `n_runs` times over the same grid and inputs, run i from x[i*n_states] with p[i*n_parameters]. `figures` gets
 * n_runs x n_outputs x HC_N_FIGURES numbers over the grid times >= times[0] + from: value at the end; largest; smallest;
 * root mean square (trapezoidal); settling time: the first grid time after which |y - y_final| <= band[output] holds to
 * the end. `final` (n_runs x n_states) gets the last states, or is NULL. `status` gets each run's result: a failed
 * run's figures are NaN and the others go on. Returns HC_NO_MEMORY or HC_OK. */
int hc_sweep(const hc_model_type *model, const hc_options *options, const double *times, long n_times,
             long n_runs, const double *x, const double *u, const double *p, double from, const double *band,
             double *figures, double *final, int *status);

/* The same for a part (or NULL), and with Runge-Kutta's steps taken by `lanes` (or NULL), HC_LANES runs at a time. */
int hc_sweep_part(const hc_model_type *model, const hc_part *part, hc_lanes_function lanes, const hc_options *options,
                  const double *times, long n_times, long n_runs, const double *x, const double *u, const double *p,
                  double from, const double *band, double *figures, double *final, int *status);

#endif
