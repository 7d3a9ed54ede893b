/* Private to the runtime: delayed inputs. `u` are the inputs set by the importer, `in` the inputs of the model: equal
 * to u, except that a delayed input has the value set one delay ago, and its start value before that. Delays are fixed at
 * initialization. An FMU without delayed inputs does not contain this code.
 */
#ifndef HC_DELAYS_H
#define HC_DELAYS_H

#include <stddef.h>

#include "hc_options.h"

/* Generated with the model: delayed inputs, the parameters that define the delays, and the delays [s]. */
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

/* The inputs of the model, n_inputs numbers; the address is valid until `delays` is freed. */
double *hc_delays_inputs(hc_delays *delays);

/* Whether a parameter defines a delay. */
int hc_delays_fixed(int parameter);

/* During initialization: nothing is pending, inputs may still change. Returns the index in `hc_late.input` of a delay
 * that is negative or not finite, or -1. */
int hc_delays_rest(hc_delays *delays, const double *u, const double *start, const double *p);

/* Send the inputs set at time t. Returns 0 if there is no memory. */
int hc_delays_send(hc_delays *delays, double t, const double *u);

/* Pass on inputs without delay; returns whether others wait to be sent. */
int hc_delays_send_prompt(hc_delays *delays, const double *u);

/* Time of the next arrival; DBL_MAX: none. */
double hc_delays_next(const hc_delays *delays);

/* Apply arrivals due at time t; returns whether `in` changed. */
int hc_delays_arrive(hc_delays *delays, double t);

/* Set the delayed inputs in an array of inputs to zero. */
void hc_delays_mask(const hc_delays *delays, double *inputs);

/* The whole state as hc_delays_count numbers, the first of which is that count. hc_delays_fit reserves room for them
 * before they are loaded; it returns 0 if they are invalid or there is no memory. */
size_t hc_delays_count(const hc_delays *delays);
void hc_delays_save(const hc_delays *delays, double *into);
int hc_delays_fit(hc_delays *delays, const double *from, size_t count);
void hc_delays_load(hc_delays *delays, const double *from);

#endif

#endif
