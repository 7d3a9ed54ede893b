/* The functions of FMI 2.0 of a corrected FMU. Other variables than those of hc_around.h, and their types, are the inner
 * FMU's own. What FMI 3.0 defines alike is in hc_around_shared.h.
 */
#include "hc_inner_fmi2.h"

#include "hc_around_shared.h"

#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void emit(const hc_log_type *log, int status, const char *category, const char *message)
{
    ((fmi2CallbackLogger)log->callback)(log->environment, log->instance, (fmi2Status)status, category, "%s", message);
}

const char *FMI2(GetTypesPlatform)(void)
{
    return "default";
}

const char *FMI2(GetVersion)(void)
{
    return "2.0";
}

fmi2Component FMI2(Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                const fmi2CallbackFunctions *functions, fmi2Boolean visible, fmi2Boolean logging)
{
    hc_log_type log = {2, name ? name : "", NULL, NULL, emit, ~0u};
    const char *wrong;
    char text[600], *place;
    hc_around *c;
    if (functions) {
        log.environment = functions->componentEnvironment;
        log.callback = (void (*)(void))functions->logger;
    }
    c = hc_around_new(&log, "fmi2Instantiate", type == fmi2ModelExchange ? HC_MODEL_EXCHANGE : HC_CO_SIMULATION, name,
                      guid);
    if (!c)
        return NULL;
    c->inner = calloc(1, sizeof *c->inner);
    place = resources ? malloc(strlen(resources) + 20) : NULL;
    if (!c->inner || (resources && !place))
        goto failed;
    wrong = hc_inner_load_2(c->inner, resources, hc_surroundings.inner_identifier, c->inner_kind, text, sizeof text);
    if (wrong) {
        hc_log_message(&log, HC_ERROR, "fmi2Instantiate", "%s", wrong);
        goto failed;
    }
    sprintf(place, "%s%sinner/resources", resources, resources[strlen(resources) - 1] == '/' ? "" : "/");
    c->inner->component =
        c->inner->Instantiate(name, c->inner_kind == HC_MODEL_EXCHANGE ? fmi2ModelExchange : fmi2CoSimulation,
                              hc_surroundings.inner_token, place, functions, visible, logging);
    if (c->inner->component && hc_around_start(c) < HC_DISCARD) {
        free(place);
        return c;
    }
failed:
    free(place);
    release(c);
    return NULL;
}

fmi2Status FMI2(SetupExperiment)(HC_ARGUMENTS, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                 fmi2Boolean has_stop, fmi2Real stop)
{
    ENTER(SetupExperiment, HC_INSTANTIATED);
    if (hc_around_experiment(c, has_tolerance, tolerance, start, has_stop, stop))
        return fmi2Error;
    return PASS(SetupExperiment, has_tolerance, tolerance, start, has_stop, stop);
}

fmi2Status FMI2(EnterInitializationMode)(HC_ARGUMENTS)
{
    fmi2Status status;
    ENTER(EnterInitializationMode, HC_INSTANTIATED);
    status = PASS_PLAIN(EnterInitializationMode);
    if (status < fmi2Discard)
        c->state = HC_INITIALIZATION;
    return status;
}

/* ---- values ---- */

fmi2Status FMI2(GetReal)(HC_REFERENCES, fmi2Real values[])
{
    ENTER(GetReal, COMPUTED);
    return (fmi2Status)hc_around_get(c, vr, n, values);
}

fmi2Status FMI2(SetReal)(HC_REFERENCES, const fmi2Real values[])
{
    ENTER(SetReal, SETTABLE);
    return (fmi2Status)hc_around_set(c, vr, n, values);
}

#define GET_AND_SET(type)                                                                                             \
    fmi2Status FMI2(Get##type)(HC_REFERENCES, fmi2##type values[])                                                    \
    {                                                                                                                 \
        ENTER(Get##type, COMPUTED);                                                                                   \
        if (c->state & (HC_INITIALIZATION | INITIALIZED) && hc_around_evaluate(c) >= HC_ERROR)                        \
            return fmi2Error;                                                                                         \
        return PASS(Get##type, vr, n, values);                                                                        \
    }                                                                                                                 \
    fmi2Status FMI2(Set##type)(HC_REFERENCES, const fmi2##type values[])                                              \
    {                                                                                                                 \
        ENTER(Set##type, SETTABLE);                                                                                   \
        if (hc_around_before_set(c) >= HC_DISCARD)                                                                    \
            return fmi2Error;                                                                                         \
        return PASS(Set##type, vr, n, values);                                                                        \
    }
GET_AND_SET(Integer)
GET_AND_SET(Boolean)
GET_AND_SET(String)

fmi2Status FMI2(GetDirectionalDerivative)(HC_ARGUMENTS, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                          const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                          fmi2Real sensitivity[])
{
    ENTER(GetDirectionalDerivative, HC_INITIALIZATION | INITIALIZED);
    return (fmi2Status)hc_around_partials(c, 0, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

/* ---- Model Exchange ---- */

fmi2Status FMI2(EnterEventMode)(HC_ARGUMENTS)
{
    ENTER(EnterEventMode, HC_EVENT | HC_CONTINUOUS_TIME);
    return c->state == HC_EVENT ? fmi2OK : (fmi2Status)hc_around_enter_event(c);
}

fmi2Status FMI2(NewDiscreteStates)(HC_ARGUMENTS, fmi2EventInfo *info)
{
    hc_inner_event event = {0, 0, 0, 0, DBL_MAX};
    int status;
    ENTER(NewDiscreteStates, HC_EVENT);
    status = hc_around_update(c, &event);
    info->newDiscreteStatesNeeded = event.again;
    info->terminateSimulation = event.terminate;
    info->nominalsOfContinuousStatesChanged = event.nominals_changed;
    info->valuesOfContinuousStatesChanged = event.states_changed;
    info->nextEventTimeDefined = event.next < DBL_MAX;
    info->nextEventTime = event.next;
    return (fmi2Status)status;
}

fmi2Status FMI2(CompletedIntegratorStep)(HC_ARGUMENTS, fmi2Boolean no_return, fmi2Boolean *enter_event_mode,
                                         fmi2Boolean *terminate)
{
    ENTER(CompletedIntegratorStep, HC_CONTINUOUS_TIME);
    (void)no_return;
    return (fmi2Status)hc_around_completed_step(c, enter_event_mode, terminate);
}

/* ---- Co-Simulation ---- */

fmi2Status FMI2(SetRealInputDerivatives)(HC_REFERENCES, const fmi2Integer orders[], const fmi2Real values[])
{
    ENTER(SetRealInputDerivatives, ANY);
    (void)vr;
    (void)n;
    (void)orders;
    (void)values;
    return (fmi2Status)hc_around_not_supported(c, "derivatives of inputs");
}

fmi2Status FMI2(GetRealOutputDerivatives)(HC_REFERENCES, const fmi2Integer orders[], fmi2Real values[])
{
    ENTER(GetRealOutputDerivatives, ANY);
    (void)vr;
    (void)n;
    (void)orders;
    (void)values;
    return (fmi2Status)hc_around_not_supported(c, "derivatives of outputs");
}

fmi2Status FMI2(DoStep)(HC_ARGUMENTS, fmi2Real time, fmi2Real length, fmi2Boolean no_return)
{
    ENTER(DoStep, HC_STEP);
    (void)no_return;
    return (fmi2Status)hc_around_step(c, time, length);
}

fmi2Status FMI2(CancelStep)(HC_ARGUMENTS)
{
    ENTER(CancelStep, 0); /* no step is ever in progress */
    return fmi2Error;
}

fmi2Status FMI2(GetRealStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Real *value)
{
    ENTER(GetRealStatus, HC_STEP | HC_TERMINATED);
    if (kind != fmi2LastSuccessfulTime)
        return fmi2Discard;
    *value = c->t;
    return fmi2OK;
}

fmi2Status FMI2(GetBooleanStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Boolean *value)
{
    ENTER(GetBooleanStatus, HC_STEP | HC_TERMINATED);
    if (kind != fmi2Terminated)
        return fmi2Discard;
    *value = c->ended;
    return fmi2OK;
}

#define NO_STATUS(function, type)                                                                                     \
    fmi2Status FMI2(function)(HC_ARGUMENTS, const fmi2StatusKind kind, type *value)                                   \
    {                                                                                                                 \
        ENTER(function, HC_STEP | HC_TERMINATED);                                                                     \
        (void)kind;                                                                                                   \
        (void)value;                                                                                                  \
        return fmi2Discard; /* steps are not asynchronous */                                                          \
    }
NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetStringStatus, fmi2String)
