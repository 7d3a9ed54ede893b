/* Private to the runtime: how the functions of the standard begin. The file that includes this one includes the
 * functions of its version before, hc_fmi2.h or hc_fmi3.h, and for a corrected FMU hc_around.h.
 */
#ifndef HC_CALLS_H
#define HC_CALLS_H

#include "hc_instance.h"

#if defined HC_FMI2_H
#define FMI(function) FMI2(function)
#define HC_FMI "fmi2"
typedef fmi2Status hc_status;
typedef fmi2Boolean hc_boolean;
typedef fmi2Byte hc_byte;
#else
#define FMI(function) FMI3(function)
#define HC_FMI "fmi3"
typedef fmi3Status hc_status;
typedef fmi3Boolean hc_boolean;
typedef fmi3Byte hc_byte;
#endif

/* RUN(job) is the runtime's function of this kind of FMU; READABLE: where states and derivatives can be read. */
#if defined HC_AROUND_H
#define RUN(job) hc_around_##job
#define READABLE (HC_INITIALIZATION | HC_EVENT | HC_CONTINUOUS_TIME)
typedef hc_around hc_fmu;
#else
#define RUN(job) hc_##job
#define READABLE COMPUTED
typedef hc_instance hc_fmu;
#endif

#define ENTER(function, allowed)                                                                                      \
    hc_fmu *c = instance;                                                                                             \
    if (!RUN(enter)(c, HC_FMI #function, allowed))                                                                    \
    return (hc_status)HC_ERROR
#define ENTER_KIND(function, allowed, kind)                                                                           \
    hc_fmu *c = instance;                                                                                             \
    if (!RUN(enter_kind)(c, HC_FMI #function, allowed, kind))                                                         \
    return (hc_status)HC_ERROR
#define ENTER_ME(function, allowed) ENTER_KIND(function, allowed, HC_MODEL_EXCHANGE)
#define ENTER_CS(function, allowed) ENTER_KIND(function, allowed, HC_CO_SIMULATION)
#define NOT_NULL(pointer)                                                                                             \
    if (hc_no_null(c, pointer, #pointer, 1))                                                                          \
    return (hc_status)HC_ERROR

#if defined HC_AROUND_H
/* Call the inner FMU's function. */
#define PASS(function, ...) (hc_status)hc_around_passed(c, (int)c->inner->function(c->inner->component, __VA_ARGS__))
#define PASS_PLAIN(function) (hc_status)hc_around_passed(c, (int)c->inner->function(c->inner->component))
#endif

#endif
