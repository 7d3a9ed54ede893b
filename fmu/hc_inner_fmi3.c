/* The FMU inside, of FMI 3.0, by the calls of hc_inner.h. */
#include "hc_inner_fmi3.h"

#define HC_INNER_ALL HC_FMI3_ALL
#define HC_INNER_COMMON HC_FMI3_COMMON
#define HC_INNER_EXCHANGE HC_FMI3_EXCHANGE
#define HC_INNER_STEPS HC_FMI3_STEPS
#define DERIVATIVES GetContinuousStateDerivatives
#define RESOURCES "resourcePath"

#include "hc_inner_shared.h"

const char *hc_inner_load_3(hc_inner *inner, const char *resources, const char *identifier, int kind, char *text,
                            size_t size)
{
    return load(inner, 3, resources, identifier, kind, text, size);
}

HC_INNER_SAVED(GetFMUState, SetFMUState, FreeFMUState, SerializedFMUStateSize, SerializeFMUState, DeserializeFMUState)

int hc_inner_get_values(hc_inner *inner, const unsigned *vr, size_t n, double *value, size_t n_values)
{
    return CALL(GetFloat64, vr, n, value, n_values);
}

int hc_inner_set_values(hc_inner *inner, const unsigned *vr, size_t n, const double *value, size_t n_values)
{
    return CALL(SetFloat64, vr, n, value, n_values);
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

int hc_inner_step(hc_inner *inner, double time, double length, int *ended)
{
    fmi3Boolean event = false, terminate = false, early = false;
    fmi3Float64 last = time + length;
    const int status = CALL(DoStep, time, length, true, &event, &terminate, &early, &last);
    *ended = terminate || early;
    return status;
}

int hc_inner_partials(hc_inner *inner, int adjoint, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                      size_t n_known, const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity)
{
    return adjoint ? CALL_IF(GetAdjointDerivative, unknown, n_unknown, known, n_known, seed, n_seed, sensitivity,
                             n_sensitivity)
                   : CALL_IF(GetDirectionalDerivative, unknown, n_unknown, known, n_known, seed, n_seed, sensitivity,
                             n_sensitivity);
}
