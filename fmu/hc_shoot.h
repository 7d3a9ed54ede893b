/* Simulations of windows of logs from given states, and the sensitivities of their ends. */
#ifndef HC_SHOOT_H
#define HC_SHOOT_H

#include "hc_slopes.h"

/* Arrays are C-contiguous; S pieces of a step from row to row, K rows, W windows. */
typedef struct {
    int n_states, n_inputs, n_parameters;
    int n_known;             /* states that depend on the commands alone, given for every piece */
    int n_columns;           /* columns of slopes; 0: no slopes */
    int euler;               /* whether the steps are Euler's, those of a sampled model in rate form */
    long windows, rows, pieces;
    const int *known;        /* n_known: which states */
    const double *time;      /* S, K-1, W: begin of each piece [s] */
    const double *step;      /* S, K-1, W: its length [s] */
    const double *inputs;    /* n_inputs, S, K-1, W */
    const double *values;    /* n_known, S, K-1, W */
    const double *parameters; /* n_parameters */
    double *states;          /* K, n_states, W; row 0 holds the initial states */
    double *slopes;          /* n_states, n_columns, W: sensitivities of the states of the last row */
    const int *of_state;     /* n_states: column of an initial state, or -1 */
    const int *of_parameter; /* n_parameters: column of a parameter, or -1; several may share one */
} hc_shoot;

/* Classical Runge-Kutta or Euler steps for windows `from` to `to`. Slopes follow from the variational equation of the discrete
 * steps, so they are exact for these. Returns 0, or 1 if there is no memory. */
int hc_shoot_run(const hc_shoot *shoot, hc_lanes_function derivatives, const hc_slopes *slopes, long from, long to);

#endif
