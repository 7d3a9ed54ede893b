/* Private to the runtime: inputs that act late. `u` is what the importer sets, `in` what the model sees: the same, but
 * for late inputs what was set one delay ago, and their start values until the first one arrives. Delays are fixed at
 * initialization. An FMU without late inputs has nothing of this.
 */
#ifndef HC_DELAYS_H
#define HC_DELAYS_H

#include <stddef.h>

#include "hc_options.h"

/* Generated with the model: which inputs act late, which parameters say how late, and what they say [s]. */
typedef struct {
    int n_late;
    const int *input;
    int n_fixed;
    const int *parameter;
    void (*seconds)(const double *p, double *delay);
} hc_delay_table;

extern const hc_delay_table hc_late;

typedef struct hc_delays hc_delays;

#if HC_DELAYS

/* NULL if there is no memory. */
hc_delays *hc_delays_new(int n_inputs);
void hc_delays_free(hc_delays *delays);

/* What the model sees, n_inputs numbers, at one address while `delays` lives. */
double *hc_delays_inputs(hc_delays *delays);

/* Whether a parameter says how late an input acts. */
int hc_delays_fixed(int parameter);

/* Before initialization ends: nothing was sent, inputs may still change. Returns the place among `hc_late.input` of a
 * delay that is negative or no number, or -1. */
int hc_delays_rest(hc_delays *delays, const double *u, const double *start, const double *p);

/* Inputs as they are set at time t. Returns 0 if there is no memory. */
int hc_delays_send(hc_delays *delays, double t, const double *u);

/* Only those that are not late; returns whether others wait to be sent. */
int hc_delays_send_prompt(hc_delays *delays, const double *u);

/* When something arrives next; DBL_MAX: never. */
double hc_delays_next(const hc_delays *delays);

/* Let arrive what is due at time t; returns whether `in` changed. */
int hc_delays_arrive(hc_delays *delays, double t);

/* Zero in an array of inputs those that are late now. */
void hc_delays_mask(const hc_delays *delays, double *inputs);

/* All that `delays` knows, as hc_delays_count numbers, the first of which is that count. hc_delays_fit makes room for
 * such numbers and returns 0 if they are none, or there is no memory; then they can be loaded. */
size_t hc_delays_count(const hc_delays *delays);
void hc_delays_save(const hc_delays *delays, double *into);
int hc_delays_fit(hc_delays *delays, const double *from, size_t count);
void hc_delays_load(hc_delays *delays, const double *from);

#endif

#endif
