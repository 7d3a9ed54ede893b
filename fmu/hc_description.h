/* Description of a model by the exporter, besides its equations; every FMU defines `hc_description`.
 *
 * Order of `names`: states, inputs, parameters, outputs. Order of `start`, `lower`, `upper`,
 * `room`, `saturates`: states, inputs, parameters.
 * An array that would be empty may be NULL.
 */
#ifndef HC_DESCRIPTION_H
#define HC_DESCRIPTION_H

#include <stddef.h>

#include "hc_options.h"

typedef struct {
    const char *name;         /* model identifier */
    const char *token;        /* instantiationToken of FMI 3, guid of FMI 2 */
    const char *const *names; /* for messages */
    const double *start;
    const double *lower, *upper; /* -HUGE_VAL and HUGE_VAL where there is no bound */
    const double *room;          /* how far outside its bounds a value counts as rounding */
    const char *saturates;       /* 1: an input that the equations clip at its bounds */
    const double *nominal;       /* of the states */
    double rtol, atol;           /* of the Co-Simulation solver; atol is times nominal. An importer's tolerance
                                    replaces rtol and scales atol with it. */
    size_t n_arrays;             /* of FMI 3 */
    const unsigned *array_first; /* value reference of the first element; ascending */
    const unsigned *array_size;  /* elements; their value references follow the first */
} hc_description_type;

extern const hc_description_type hc_description;

#endif
