/* Private to the runtime: past values of signals that vary continuously, for sensors that tell them late. Rows of a
 * time and one value for each signal are kept as far back as the longest delay; between them a signal is Lagrange's
 * polynomial through the four rows around, three or two where a signal jumps.
 */
#ifndef HC_HISTORY_H
#define HC_HISTORY_H

#include <stddef.h>

#include "hc_options.h"

typedef struct {
    int n;              /* signals */
    size_t first, rows, room;
    double *row;        /* 1 + n numbers each; `rows` from `first` on are kept */
    double *delay;      /* n [s] */
    double *before;     /* n: value before the first has arrived */
} hc_history;

/* 0 if there is no memory. */
int hc_history_new(hc_history *h, int n);
void hc_history_free(hc_history *h);

/* Forget all rows. */
void hc_history_clear(hc_history *h);
/* Keep the values at time t, not before the last row. A row at the same time as the last one is a jump, unless
 * values are equal. Returns 0 if there is no memory. */
int hc_history_keep(hc_history *h, double t, const double *value);
/* Signal k as it was told at time t: its value at t - delay[k]; `now` are the values at t, if they are not kept. */
double hc_history_late(const hc_history *h, int k, double t, double now);

/* All rows, delays and early values as doubles, the first of which is their count; 0 from hc_history_load: invalid, or
 * no memory. */
size_t hc_history_count(const hc_history *h);
void hc_history_save(const hc_history *h, double *into);
int hc_history_load(hc_history *h, const double *from, size_t count);

#endif
