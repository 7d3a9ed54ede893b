/* The FMU inside, by the calls of hc_inner.h: what FMI 2.0 and FMI 3.0 define alike. hc_inner_fmi2.c and hc_inner_fmi3.c
 * each include this file once, after GET, SET, DERIVATIVES, RESOURCES and what is named HC_... here.
 */
#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hc_calls.h"

static const char *load(hc_inner *inner, int version, const char *resources, const char *identifier, int kind, char *text,
                        size_t size)
{
    char *place = hc_library_place(identifier, version);
    char *path = resources && place ? hc_library_path(resources, place) : NULL;
    void (*found)(void);
    free(place);
    if (!path) {
        snprintf(text, size, "%s", resources ? "no memory" : RESOURCES " is NULL: the FMU inside lies there");
        return text;
    }
    inner->library = hc_library_open(path, text, size);
    free(path);
    if (!inner->library)
        return text;
#define FIND(function)                                                                                                \
    found = hc_library_find(inner->library, HC_FMI #function);                                                        \
    memcpy(&inner->function, &found, sizeof found);
    HC_INNER_ALL(FIND)
#undef FIND
#define NEED(function)                                                                                                \
    if (!inner->function) {                                                                                           \
        snprintf(text, size, "the FMU inside lacks the function %s%s", HC_FMI, #function);                            \
        return text;                                                                                                  \
    }
    HC_INNER_COMMON(NEED)
    if (kind == HC_MODEL_EXCHANGE) {
        HC_INNER_EXCHANGE(NEED)
    } else {
        HC_INNER_STEPS(NEED)
    }
#undef NEED
    return NULL;
}

#define CALL(function, ...) (int)inner->function(inner->component, __VA_ARGS__)
#define CALL_IF(function, ...) (inner->function ? CALL(function, __VA_ARGS__) : HC_ERROR)

int hc_inner_set_time(hc_inner *inner, double time)
{
    return CALL(SetTime, time);
}

int hc_inner_set_states(hc_inner *inner, const double *x, size_t n)
{
    return n == 0 ? HC_DONE : CALL(SetContinuousStates, x, n);
}

int hc_inner_get_states(hc_inner *inner, double *x, size_t n)
{
    return n == 0 ? HC_DONE : CALL(GetContinuousStates, x, n);
}

int hc_inner_get_derivatives(hc_inner *inner, double *dx, size_t n)
{
    return n == 0 ? HC_DONE : CALL(DERIVATIVES, dx, n);
}

int hc_inner_get_indicators(hc_inner *inner, double *z, size_t n)
{
    return n == 0 ? HC_DONE : CALL(GetEventIndicators, z, n);
}

int hc_inner_get_nominals(hc_inner *inner, double *x, size_t n)
{
    return n == 0 ? HC_DONE : CALL(GetNominalsOfContinuousStates, x, n);
}

int hc_inner_completed_step(hc_inner *inner, int *event, int *terminate)
{
    hc_boolean enter = 0, end = 0;
    const int status = CALL(CompletedIntegratorStep, (hc_boolean)1, &enter, &end);
    *event = enter != 0;
    *terminate = end != 0;
    return status;
}

int hc_inner_enter_event(hc_inner *inner)
{
    return (int)inner->EnterEventMode(inner->component);
}

int hc_inner_enter_continuous(hc_inner *inner)
{
    return (int)inner->EnterContinuousTimeMode(inner->component);
}

int hc_inner_reset(hc_inner *inner)
{
    return (int)inner->Reset(inner->component);
}

int hc_inner_get(hc_inner *inner, const unsigned *vr, size_t n, double *value)
{
    return n == 0 ? HC_DONE : hc_inner_get_values(inner, vr, n, value, n);
}

int hc_inner_set(hc_inner *inner, const unsigned *vr, size_t n, const double *value)
{
    return n == 0 ? HC_DONE : hc_inner_set_values(inner, vr, n, value, n);
}

#define SAVED(job, function, arguments, ...)                                                                          \
    int hc_inner_##job arguments                                                                                      \
    {                                                                                                                 \
        return CALL_IF(function, __VA_ARGS__);                                                                        \
    }
#define HC_INNER_SAVED(get, set, release, size_of, into, from)                                                        \
    SAVED(save, get, (hc_inner * inner, void **state), state)                                                         \
    SAVED(load, set, (hc_inner * inner, void *state), state)                                                          \
    SAVED(forget, release, (hc_inner * inner, void **state), state)                                                   \
    SAVED(bytes, size_of, (hc_inner * inner, void *state, size_t *size), state, size)                                 \
    SAVED(write, into, (hc_inner * inner, void *state, unsigned char *bytes, size_t size), state, (hc_byte *)bytes,  \
          size)                                                                                                       \
    SAVED(read, from, (hc_inner * inner, const unsigned char *bytes, size_t size, void **state),                      \
          (const hc_byte *)bytes, size, state)
