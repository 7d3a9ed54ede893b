/* Windows of logs, each simulated from states of its own, and what their ends change with. */
#ifndef HC_SHOOT_H
#define HC_SHOOT_H

#include "hc_slopes.h"

/* Arrays are C-contiguous; S pieces of a step from row to row, K rows, W windows. */
typedef struct {
    int n_states, n_inputs, n_parameters;
    int n_known;             /* states that the commands alone decide, given for every piece */
    int n_columns;           /* of slopes; 0: none are asked for */
    long windows, rows, pieces;
    const int *known;        /* n_known: which states */
    const double *time;      /* S, K-1, W: begin of each piece [s] */
    const double *step;      /* S, K-1, W: its length [s] */
    const double *inputs;    /* n_inputs, S, K-1, W */
    const double *values;    /* n_known, S, K-1, W */
    const double *parameters; /* n_parameters */
    double *states;          /* K, n_states, W; row 0 is where the runs begin */
    double *slopes;          /* n_states, n_columns, W: what the states of the last row change with */
    const int *of_state;     /* n_states: the column of what a state begins with, or -1 */
    const int *of_parameter; /* n_parameters: its column, or -1; some may share one */
} hc_shoot;

/* Classical Runge-Kutta for windows `from` to `to`. Slopes follow from the variational equation, exact for these very
 * steps. Returns 0, or 1 if there is no memory. */
int hc_shoot_run(const hc_shoot *shoot, hc_lanes_function derivatives, const hc_slopes *slopes, long from, long to);

#endif
