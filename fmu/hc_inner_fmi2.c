/* The FMU inside, of FMI 2.0, by the calls of hc_inner.h. */
#include "hc_inner_fmi2.h"

#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hc_instance.h"

const char *hc_inner_load_2(hc_inner *inner, const char *resources, const char *identifier, int kind, char *text,
                            size_t size)
{
    char *place = hc_library_place(identifier, 2);
    char *path = resources && place ? hc_library_path(resources, place) : NULL;
    void (*found)(void);
    free(place);
    if (!path) {
        snprintf(text, size, "%s", resources ? "no memory" : "fmuResourceLocation is NULL: the FMU inside lies there");
        return text;
    }
    inner->library = hc_library_open(path, text, size);
    free(path);
    if (!inner->library)
        return text;
#define FIND(function)                                                                                                \
    found = hc_library_find(inner->library, "fmi2" #function);                                                        \
    memcpy(&inner->function, &found, sizeof found);
    HC_FMI2_ALL(FIND)
#undef FIND
#define NEED(function)                                                                                                \
    if (!inner->function) {                                                                                           \
        snprintf(text, size, "the FMU inside lacks the function fmi2%s", #function);                                  \
        return text;                                                                                                  \
    }
    HC_FMI2_COMMON(NEED)
    if (kind == HC_MODEL_EXCHANGE) {
        HC_FMI2_EXCHANGE(NEED)
    } else {
        NEED(DoStep)
    }
#undef NEED
    return NULL;
}

#define CALL(function, ...) (int)inner->function(inner->component, __VA_ARGS__)
#define CALL_IF(function, ...) (inner->function ? CALL(function, __VA_ARGS__) : HC_ERROR)

int hc_inner_get(hc_inner *inner, const unsigned *vr, size_t n, double *value)
{
    return n == 0 ? HC_DONE : CALL(GetReal, vr, n, value);
}

int hc_inner_set(hc_inner *inner, const unsigned *vr, size_t n, const double *value)
{
    return n == 0 ? HC_DONE : CALL(SetReal, vr, n, value);
}

int hc_inner_get_values(hc_inner *inner, const unsigned *vr, size_t n, double *value, size_t n_values)
{
    (void)n_values; /* FMI 2 has no arrays */
    return CALL(GetReal, vr, n, value);
}

int hc_inner_set_values(hc_inner *inner, const unsigned *vr, size_t n, const double *value, size_t n_values)
{
    (void)n_values; /* FMI 2 has no arrays */
    return CALL(SetReal, vr, n, value);
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
    return n == 0 ? HC_DONE : CALL(GetDerivatives, dx, n);
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
    fmi2Boolean enter = 0, end = 0;
    const int status = CALL(CompletedIntegratorStep, 1, &enter, &end);
    *event = enter != 0;
    *terminate = end != 0;
    return status;
}

int hc_inner_enter_event(hc_inner *inner)
{
    return (int)inner->EnterEventMode(inner->component);
}

int hc_inner_update(hc_inner *inner, hc_inner_event *event)
{
    fmi2EventInfo info = {0, 0, 0, 0, 0, 0.0};
    const int status = CALL(NewDiscreteStates, &info);
    event->again = info.newDiscreteStatesNeeded != 0;
    event->terminate = info.terminateSimulation != 0;
    event->nominals_changed = info.nominalsOfContinuousStatesChanged != 0;
    event->states_changed = info.valuesOfContinuousStatesChanged != 0;
    event->next = info.nextEventTimeDefined ? info.nextEventTime : DBL_MAX;
    return status;
}

int hc_inner_enter_continuous(hc_inner *inner)
{
    return (int)inner->EnterContinuousTimeMode(inner->component);
}

int hc_inner_step(hc_inner *inner, double time, double length, int *ended)
{
    const int status = CALL(DoStep, time, length, 1);
    *ended = 0;
    return status == (int)fmi2Pending ? HC_ERROR : status; /* the description allows no step that goes on */
}

int hc_inner_reset(hc_inner *inner)
{
    return (int)inner->Reset(inner->component);
}

int hc_inner_partials(hc_inner *inner, int adjoint, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                      size_t n_known, const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity)
{
    (void)n_seed; /* FMI 2 has no arrays and no adjoint derivatives */
    (void)n_sensitivity;
    return adjoint ? HC_ERROR : CALL_IF(GetDirectionalDerivative, unknown, n_unknown, known, n_known, seed, sensitivity);
}

int hc_inner_save(hc_inner *inner, void **state)
{
    return CALL_IF(GetFMUstate, state);
}

int hc_inner_load(hc_inner *inner, void *state)
{
    return CALL_IF(SetFMUstate, state);
}

int hc_inner_forget(hc_inner *inner, void **state)
{
    return CALL_IF(FreeFMUstate, state);
}

int hc_inner_bytes(hc_inner *inner, void *state, size_t *size)
{
    return CALL_IF(SerializedFMUstateSize, state, size);
}

int hc_inner_write(hc_inner *inner, void *state, unsigned char *bytes, size_t size)
{
    return CALL_IF(SerializeFMUstate, state, (fmi2Byte *)bytes, size);
}

int hc_inner_read(hc_inner *inner, const unsigned char *bytes, size_t size, void **state)
{
    return CALL_IF(DeSerializeFMUstate, (const fmi2Byte *)bytes, size, state);
}
