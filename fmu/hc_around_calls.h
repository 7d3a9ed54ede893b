/* Private to the runtime: how the functions of FMI 2.0 and 3.0 of a corrected FMU begin, and call those of the inner
 * FMU. The file that includes this one includes hc_inner_fmi2.h or hc_inner_fmi3.h first.
 */
#ifndef HC_AROUND_CALLS_H
#define HC_AROUND_CALLS_H

#include "hc_around.h"

#if defined HC_INNER_FMI2_H
#define FMI(function) FMI2(function)
#define HC_FMI "fmi2"
typedef fmi2Status hc_status;
typedef fmi2Boolean hc_boolean;
#else
#define FMI(function) FMI3(function)
#define HC_FMI "fmi3"
typedef fmi3Status hc_status;
typedef fmi3Boolean hc_boolean;
#endif

#define ENTER(function, allowed)                                                                                      \
    hc_around *c = instance;                                                                                          \
    if (!hc_around_enter(c, HC_FMI #function, allowed))                                                               \
    return (hc_status)HC_ERROR
/* Call the inner FMU's function. */
#define PASS(function, ...) (hc_status)hc_around_passed(c, (int)c->inner->function(c->inner->component, __VA_ARGS__))
#define PASS_PLAIN(function) (hc_status)hc_around_passed(c, (int)c->inner->function(c->inner->component))

#endif
