/* Interface of a generated model. One Block is one model; every model file defines `hc_model`.
 *
 * Arrays: x states, u inputs, p parameters, y outputs, in the Block's order; mode one entry per dry friction.
 * A dry friction k acts on the velocity x[friction_state[k]] through s in [-1, 1], the value of its sgn:
 *     v' = a + b s,   b <= 0
 * mode[k] = +1 or -1: slipping that way, s = mode[k].  mode[k] = 0: sticking, v = 0 and v' = 0 while |a| <= |b|.
 * Each velocity has one friction at most; a and b hold with the other frictions in their modes.
 * In a model generated with regularised friction (n_friction = 0) s = tanh(v/width) everywhere.
 * All functions are pure: no state, no allocation, safe from many threads.
 */
#ifndef HC_MODEL_H
#define HC_MODEL_H

#include "hc_options.h"

typedef struct {
    int n_states, n_inputs, n_parameters, n_outputs, n_friction;
    const int *friction_state;
    /* dx = derivatives, not of held states; a sticking velocity has dx = 0 */
    void (*derivatives)(double t, const double *x, const double *u, const double *p, const int *mode, double *dx);
    void (*outputs)(double t, const double *x, const double *u, const double *p, const int *mode, double *y);
    /* a[k], b[k] of every dry friction as above (the other frictions in their modes) */
    void (*friction)(double t, const double *x, const double *u, const double *p, const int *mode, double *a,
                     double *b);
    /* Partial derivatives that are not identically zero, sorted by row, then column: value[i] belongs to
     * partial_row[i] (derivatives, then outputs) and partial_column[i] (states, then inputs, then parameters). */
    int n_partials;
    const unsigned short *partial_row, *partial_column;
    void (*partials)(double t, const double *x, const double *u, const double *p, const int *mode, double *value);
    /* the first time after t at which a condition on time changes; DBL_MAX: never. May be NULL: never. */
    double (*next_switch)(double t, const double *p);
    /* A hybrid model: the last n_held states hold their values between ticks and have no derivative. Tick k is due at
     * every multiple of tick_period[k] / fractions seconds, both whole numbers below 2^53; ticks that are due together
     * are taken in their order. tick writes what it sets to next, which has the held states, and leaves the others. */
    int n_held, n_ticks;
    const double *tick_period;
    double fractions;
    void (*tick)(int k, double t, const double *x, const double *u, const double *p, const int *mode, double *next);
} hc_model_type;

extern const hc_model_type hc_model;

#endif
