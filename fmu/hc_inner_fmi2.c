/* The FMU inside, of FMI 2.0, by the calls of hc_inner.h. */
#include "hc_inner_fmi2.h"

#define HC_INNER_ALL HC_FMI2_ALL
#define HC_INNER_COMMON HC_FMI2_COMMON
#define HC_INNER_EXCHANGE HC_FMI2_EXCHANGE
#define HC_INNER_STEPS(X) X(DoStep)
#define DERIVATIVES GetDerivatives
#define RESOURCES "fmuResourceLocation"

#include "hc_inner_shared.h"

const char *hc_inner_load_2(hc_inner *inner, const char *resources, const char *identifier, int kind, char *text,
                            size_t size)
{
    return load(inner, 2, resources, identifier, kind, text, size);
}

HC_INNER_SAVED(GetFMUstate, SetFMUstate, FreeFMUstate, SerializedFMUstateSize, SerializeFMUstate, DeSerializeFMUstate)

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

int hc_inner_step(hc_inner *inner, double time, double length, int *ended)
{
    const int status = CALL(DoStep, time, length, 1);
    *ended = 0;
    return status == (int)fmi2Pending ? HC_ERROR : status; /* the description allows no step that goes on */
}

int hc_inner_partials(hc_inner *inner, int adjoint, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                      size_t n_known, const double *seed, size_t n_seed, double *sensitivity, size_t n_sensitivity)
{
    (void)n_seed; /* FMI 2 has no arrays and no adjoint derivatives */
    (void)n_sensitivity;
    return adjoint ? HC_ERROR : CALL_IF(GetDirectionalDerivative, unknown, n_unknown, known, n_known, seed, sensitivity);
}
