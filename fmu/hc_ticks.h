/* Ticks of a hybrid model: which are due, and the states they set. Times of ticks are multiples of a fraction of a
 * second, counted exactly in doubles.
 */
#ifndef HC_TICKS_H
#define HC_TICKS_H

#include <math.h>
#include <stddef.h>

#include "hc_model.h"
#include "hc_numbers.h"

typedef struct {
    const hc_model_type *model;
    double next;         /* time of the next tick [s]; DBL_MAX: none */
    double at;           /* time of the last executed ticks */
    double room;         /* how far from a time a tick may be that is at that time [s] */
    int ticked;          /* they can be repeated, see hc_ticks_again */
    double *due;         /* n_ticks: when each is due next, in fractions */
    double *due_before;  /* `due` and the held states before the last ticks */
    double *before;      /* n_held */
    double *work;        /* n_held */
} hc_ticks;

#define HC_TICK_SHARE 1e-6 /* in Co-Simulation, whose importers sum up their steps; elsewhere 0: rounding only */

/* Numbers that hc_ticks_place needs, and the arrays of `ticks` in them. Ticks within this share of the shortest period
 * of a time are at that time. */
size_t hc_ticks_size(const hc_model_type *model);
void hc_ticks_place(hc_ticks *ticks, const hc_model_type *model, double share, double *numbers);

/* Copy the held states from one array of all states to another. */
void hc_ticks_hold(const hc_model_type *model, double *into, const double *from);

/* Start at time t; ticks at t are due. */
void hc_ticks_start(hc_ticks *ticks, double t);

/* Whether two times are the same. */
static inline int hc_ticks_same(const hc_ticks *ticks, double t, double other)
{
    return fabs(t - other) <= ticks->room + hc_room(t);
}

/* Whether a tick is due at or before time t; whether one is due before t. */
int hc_ticks_due(const hc_ticks *ticks, double t);
int hc_ticks_before(const hc_ticks *ticks, double t);

/* Execute the ticks due at time t, which see the exact time `next`; x has all states, of which the held ones change. */
void hc_ticks_take(hc_ticks *ticks, double t, double *x, const double *u, const double *p, const int *mode);

/* Repeat the ticks of the last hc_ticks_take at the same time, after inputs or parameters have jumped. */
void hc_ticks_again(hc_ticks *ticks, double t, double *x, const double *u, const double *p, const int *mode);

#endif
