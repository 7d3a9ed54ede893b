/* Private to the runtime: one run over a grid of times, step by step. */
#ifndef HC_RUNS_H
#define HC_RUNS_H

#include "hc_simulate.h"
#include "hc_solver_internal.h"

typedef struct {
    const double *times;
    long n_times;
    const double *u; /* n_times rows, or NULL */
} hc_grid;

typedef struct hc_run {
    hc_solver *solver;
    const hc_grid *grid;
    const hc_part *part;      /* or NULL */
    double *states, *outputs; /* rows of results, or NULL */
    double *x;                /* work space, n_states */
    long row, stop;           /* next row to write, and next row at which a step must end */
    int status;
} hc_run;

/* Start a run whose solver, grid, part and result arrays are set, from x0 with p. */
void hc_run_begin(hc_run *run, const double *x0, const double *p);

/* Take one step and write the rows that it reached. */
void hc_run_step(hc_run *run);

static inline int hc_run_goes_on(const hc_run *run)
{
    return run->status == HC_OK && run->row < run->grid->n_times;
}

/* Write the final states, and NaN into rows that were not reached. */
void hc_run_end(hc_run *run, double *x_end);

#endif
