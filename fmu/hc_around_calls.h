/* Private to the runtime: how the functions of FMI 3.0 of a corrected FMU begin, and call those of the inner FMU. */
#ifndef HC_AROUND_CALLS_H
#define HC_AROUND_CALLS_H

#include "hc_around.h"
#include "hc_inner_fmi3.h"

#define ENTER(function, allowed)                                                                                      \
    hc_around *c = instance;                                                                                          \
    if (!hc_around_enter(c, "fmi3" #function, allowed))                                                               \
    return fmi3Error
#define PASS(function, ...) (fmi3Status)hc_around_passed(c, (int)c->inner->function(c->inner->component, __VA_ARGS__))
#define PASS_PLAIN(function) (fmi3Status)hc_around_passed(c, (int)c->inner->function(c->inner->component))

#endif
