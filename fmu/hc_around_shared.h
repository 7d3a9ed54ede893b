/* The functions of a corrected FMU that FMI 2.0 and 3.0 define alike. hc_around_fmi2.c and hc_around_fmi3.c each
 * include this file once: a name such as FMI(Reset) is fmi2Reset or fmi3Reset there.
 */
#include "hc_around_calls.h"

#include <stdlib.h>

static void release(hc_around *c)
{
    if (!c)
        return;
    if (c->inner && c->inner->component)
        c->inner->FreeInstance(c->inner->component);
    if (c->inner && c->inner->library)
        hc_library_close(c->inner->library);
    free(c->inner);
    hc_around_free(c);
}

void FMI(FreeInstance)(HC_ARGUMENTS)
{
    release(instance);
}

hc_status FMI(SetDebugLogging)(HC_ARGUMENTS, hc_boolean on, size_t n, const char *const categories[])
{
    ENTER(SetDebugLogging, ANY);
    return PASS(SetDebugLogging, on, n, categories);
}

hc_status FMI(ExitInitializationMode)(HC_ARGUMENTS)
{
    hc_status status;
    ENTER(ExitInitializationMode, HC_INITIALIZATION);
    if (hc_around_before_exit(c) >= HC_DISCARD)
        return (hc_status)HC_ERROR;
    status = PASS_PLAIN(ExitInitializationMode);
    return (int)status < HC_DISCARD ? (hc_status)hc_around_after_exit(c) : status;
}

hc_status FMI(Terminate)(HC_ARGUMENTS)
{
    ENTER(Terminate, INITIALIZED);
    c->state = HC_TERMINATED;
    return PASS_PLAIN(Terminate);
}

hc_status FMI(Reset)(HC_ARGUMENTS)
{
    hc_status status;
    ENTER(Reset, ANY);
    status = PASS_PLAIN(Reset);
    return (int)status < HC_DISCARD ? (hc_status)hc_around_start(c) : status;
}

/* ---- Model Exchange ---- */

hc_status FMI(EnterContinuousTimeMode)(HC_ARGUMENTS)
{
    ENTER(EnterContinuousTimeMode, HC_EVENT);
    return (hc_status)hc_around_enter_continuous(c);
}

hc_status FMI(SetContinuousStates)(HC_ARGUMENTS, const double states[], size_t n)
{
    ENTER(SetContinuousStates, HC_CONTINUOUS_TIME);
    return (hc_status)hc_around_set_states(c, states, n);
}

hc_status FMI(GetContinuousStates)(HC_ARGUMENTS, double states[], size_t n)
{
    ENTER(GetContinuousStates, HC_INITIALIZATION | HC_EVENT | HC_CONTINUOUS_TIME);
    return (hc_status)hc_around_get_states(c, states, n);
}

hc_status FMI(GetEventIndicators)(HC_ARGUMENTS, double indicators[], size_t n)
{
    ENTER(GetEventIndicators, HC_INITIALIZATION | HC_EVENT | HC_CONTINUOUS_TIME);
    return (hc_status)hc_around_indicators(c, indicators, n);
}
