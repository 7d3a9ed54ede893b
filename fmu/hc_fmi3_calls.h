/* Private to the runtime: the checks at the start of every function of FMI 3.0. */
#ifndef HC_FMI3_CALLS_H
#define HC_FMI3_CALLS_H

#include "hc_fmi3.h"
#include "hc_instance.h"

#define ENTER(function, allowed)                                                                                      \
    hc_instance *c = instance;                                                                                        \
    if (!hc_enter(c, "fmi3" #function, allowed))                                                                      \
    return fmi3Error
#define ENTER_ME(function, allowed)                                                                                   \
    hc_instance *c = instance;                                                                                        \
    if (!hc_enter_kind(c, "fmi3" #function, allowed, HC_MODEL_EXCHANGE))                                              \
    return fmi3Error
#define NOT_NULL(pointer)                                                                                             \
    if (hc_no_null(c, pointer, #pointer, 1))                                                                          \
    return fmi3Error

#endif
