/* Windows of logs, each simulated from states of its own, with several copies whose states or parameters differ. */
#ifndef HC_SHOOT_H
#define HC_SHOOT_H

#include "hc_lanes.h"

/* Arrays are C-contiguous; S pieces of a step from row to row, K rows, C copies, W windows. */
typedef struct {
    int n_states, n_inputs, n_parameters;
    int n_known;             /* states that the commands alone decide, given for every piece */
    long windows, rows, pieces, copies;
    long ways;               /* 1, or as many as copies: what arrives differs from copy to copy */
    const int *known;        /* n_known: which states */
    const double *time;      /* S, K-1, W: begin of each piece [s] */
    const double *step;      /* S, K-1, ways, W: its length [s] */
    const double *inputs;    /* n_inputs, S, K-1, ways, W */
    const double *values;    /* n_known, S, K-1, ways, W */
    const double *parameters; /* n_parameters, C */
    double *states;          /* K, n_states, C, W; row 0 is where the runs begin */
} hc_shoot;

/* Classical Runge-Kutta for windows `from` to `to`. Returns 0, or 1 if there is no memory. */
int hc_shoot_run(const hc_shoot *shoot, hc_lanes_function derivatives, long from, long to);

#endif
