/* Ticks of a hybrid model: which are due, and what they set. A tick's times are whole numbers of a fraction of a
 * second, counted exactly in doubles; one that is nearer to a time than rounding is at that time.
 */
#ifndef HC_TICKS_H
#define HC_TICKS_H

#include <stddef.h>

#include "hc_model.h"
#include "hc_numbers.h"

typedef struct {
    const hc_model_type *model;
    double next;         /* time of the next tick [s]; DBL_MAX: none */
    double at;           /* time at which ticks were taken last */
    int ticked;          /* they can be taken again, see hc_ticks_again */
    double *due;         /* n_ticks: when each is due next, in fractions */
    double *due_before;  /* likewise, and the held states, before the last ticks were taken */
    double *before;      /* n_held */
    double *work;        /* n_held */
} hc_ticks;

/* Numbers that hc_ticks_place needs, and the arrays of `ticks` in them. */
size_t hc_ticks_size(const hc_model_type *model);
void hc_ticks_place(hc_ticks *ticks, const hc_model_type *model, double *numbers);

/* Give an array of all states the held ones of another. */
void hc_ticks_hold(const hc_model_type *model, double *into, const double *from);

/* From time t on, those of t included. */
void hc_ticks_start(hc_ticks *ticks, double t);

/* Whether one is due at time t, or was before; whether one comes before t, by more than rounding. */
int hc_ticks_due(const hc_ticks *ticks, double t);
int hc_ticks_before(const hc_ticks *ticks, double t);

/* Take the ticks due at time t; x are all states, of which those that are held change. They see t as `next` has it. */
void hc_ticks_take(hc_ticks *ticks, double t, double *x, const double *u, const double *p, const int *mode);

/* Take those of the last hc_ticks_take again, at the same time, because inputs or parameters jumped. */
void hc_ticks_again(hc_ticks *ticks, double t, double *x, const double *u, const double *p, const int *mode);

#endif
