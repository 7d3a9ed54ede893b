/* The FMU inside, of FMI 3.0, by the calls of hc_inner.h. */
#include "hc_inner_fmi3.h"

#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hc_instance.h"

const char *hc_inner_load_3(hc_inner *inner, const char *resources, const char *identifier, int kind, char *text,
                            size_t size)
{
    char *place = hc_library_place(identifier, 3);
    char *path = resources && place ? hc_library_path(resources, place) : NULL;
    void (*found)(void);
    free(place);
    if (!path) {
        snprintf(text, size, "%s", resources ? "no memory" : "resourcePath is NULL: the FMU inside lies there");
        return text;
    }
    inner->library = hc_library_open(path, text, size);
    free(path);
    if (!inner->library)
        return text;
#define FIND(function)                                                                                                \
    found = hc_library_find(inner->library, "fmi3" #function);                                                        \
    memcpy(&inner->function, &found, sizeof found);
    HC_FMI3_ALL(FIND)
#undef FIND
#define NEED(function)                                                                                                \
    if (!inner->function) {                                                                                           \
        snprintf(text, size, "the FMU inside lacks the function fmi3%s", #function);                                  \
        return text;                                                                                                  \
    }
    HC_FMI3_COMMON(NEED)
    if (kind == HC_MODEL_EXCHANGE) {
        HC_FMI3_EXCHANGE(NEED)
    } else {
        HC_FMI3_STEPS(NEED)
    }
#undef NEED
    return NULL;
}

#define CALL(function, ...) (int)inner->function(inner->component, __VA_ARGS__)
#define CALL_IF(function, ...) (inner->function ? CALL(function, __VA_ARGS__) : HC_ERROR)

int hc_inner_get(hc_inner *inner, const unsigned *vr, size_t n, double *value)
{
    return n == 0 ? HC_DONE : CALL(GetFloat64, vr, n, value, n);
}

int hc_inner_set(hc_inner *inner, const unsigned *vr, size_t n, const double *value)
{
    return n == 0 ? HC_DONE : CALL(SetFloat64, vr, n, value, n);
}

int hc_inner_get_values(hc_inner *inner, const unsigned *vr, size_t n, double *value, size_t n_values)
{
    return CALL(GetFloat64, vr, n, value, n_values);
}

int hc_inner_set_values(hc_inner *inner, const unsigned *vr, size_t n, const double *value, size_t n_values)
{
    return CALL(SetFloat64, vr, n, value, n_values);
}

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
    return n == 0 ? HC_DONE : CALL(GetContinuousStateDerivatives, dx, n);
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
    fmi3Boolean enter = false, end = false;
    const int status = CALL(CompletedIntegratorStep, true, &enter, &end);
    *event = enter;
    *terminate = end;
    return status;
}

int hc_inner_enter_event(hc_inner *inner)
{
    return (int)inner->EnterEventMode(inner->component);
}

int hc_inner_update(hc_inner *inner, hc_inner_event *event)
{
    fmi3Boolean again = false, end = false, nominals = false, states = false, timed = false;
    fmi3Float64 next = 0.0;
    const int status = CALL(UpdateDiscreteStates, &again, &end, &nominals, &states, &timed, &next);
    event->again = again;
    event->terminate = end;
    event->nominals_changed = nominals;
    event->states_changed = states;
    event->next = timed ? next : DBL_MAX;
    return status;
}

int hc_inner_enter_continuous(hc_inner *inner)
{
    return (int)inner->EnterContinuousTimeMode(inner->component);
}

int hc_inner_step(hc_inner *inner, double time, double length, int *ended)
{
    fmi3Boolean event = false, terminate = false, early = false;
    fmi3Float64 last = time + length;
    const int status = CALL(DoStep, time, length, true, &event, &terminate, &early, &last);
    *ended = terminate || early;
    return status;
}

int hc_inner_reset(hc_inner *inner)
{
    return (int)inner->Reset(inner->component);
}

int hc_inner_partials(hc_inner *inner, int adjoint, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                      size_t n_known, const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity)
{
    return adjoint ? CALL_IF(GetAdjointDerivative, unknown, n_unknown, known, n_known, seed, n_seed, sensitivity,
                             n_sensitivity)
                   : CALL_IF(GetDirectionalDerivative, unknown, n_unknown, known, n_known, seed, n_seed, sensitivity,
                             n_sensitivity);
}

int hc_inner_save(hc_inner *inner, void **state)
{
    return CALL_IF(GetFMUState, state);
}

int hc_inner_load(hc_inner *inner, void *state)
{
    return CALL_IF(SetFMUState, state);
}

int hc_inner_forget(hc_inner *inner, void **state)
{
    return CALL_IF(FreeFMUState, state);
}

int hc_inner_bytes(hc_inner *inner, void *state, size_t *size)
{
    return CALL_IF(SerializedFMUStateSize, state, size);
}

int hc_inner_write(hc_inner *inner, void *state, unsigned char *bytes, size_t size)
{
    return CALL_IF(SerializeFMUState, state, bytes, size);
}

int hc_inner_read(hc_inner *inner, const unsigned char *bytes, size_t size, void **state)
{
    return CALL_IF(DeserializeFMUState, bytes, size, state);
}
