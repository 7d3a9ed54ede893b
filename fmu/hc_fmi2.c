/* FMI 2.0 in terms of hc_instance.h: which call is allowed in which state (FMI 2.0.5, tables of sections 3.2.3 and
 * 4.2.4), and the types of the standard. Two rules are wider than the tables: start values of
 * inputs may be set before Initialization Mode, and time may be set in Event Mode, as in FMI 2.0.0.
 */
#include "hc_fmi2.h"

#include <float.h>

#include "hc_table.h"

HC_TABLE(HC_FUNCTION)

/* ---- instances and modes ---- */

static void emit(const hc_log_type *log, int status, const char *category, const char *message)
{
    char text[1200];
    size_t n = 0;
    for (; *message && n + 2 < sizeof text; message++) {
        text[n++] = *message;
        if (*message == '#' || *message == '%') /* start of a value reference or a format */
            text[n++] = *message;
    }
    text[n] = '\0';
    ((fmi2CallbackLogger)log->callback)(log->environment, log->instance, (fmi2Status)status, category, text);
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
    hc_log_type log = {2, name ? name : "", NULL, NULL, emit, 0};
    (void)resources;
    (void)visible;
    if (functions) {
        log.environment = functions->componentEnvironment;
        log.callback = (void (*)(void))functions->logger;
    }
    log.categories = logging ? ~0u : 1u << HC_ERROR;
    return hc_instance_new(&log, "fmi2Instantiate", type == fmi2ModelExchange ? HC_MODEL_EXCHANGE : HC_CO_SIMULATION,
                            name, guid);
}

void FMI2(FreeInstance)(HC_ARGUMENTS)
{
    hc_instance_free(instance);
}

fmi2Status FMI2(SetupExperiment)(HC_ARGUMENTS, fmi2Boolean has_tolerance, fmi2Real tolerance, fmi2Real start,
                                 fmi2Boolean has_stop, fmi2Real stop)
{
    ENTER(SetupExperiment, HC_INSTANTIATED);
    return (fmi2Status)hc_set_experiment(c, has_tolerance, tolerance, start, has_stop, stop);
}

fmi2Status FMI2(EnterInitializationMode)(HC_ARGUMENTS)
{
    ENTER(EnterInitializationMode, HC_INSTANTIATED);
    c->state = HC_INITIALIZATION;
    return fmi2OK;
}

/* ---- values ---- */

fmi2Status FMI2(GetReal)(HC_REFERENCES, fmi2Real values[])
{
    ENTER(GetReal, COMPUTED);
    return (fmi2Status)hc_get_reals(c, vr, n, values);
}

fmi2Status FMI2(SetReal)(HC_REFERENCES, const fmi2Real values[])
{
    ENTER(SetReal, SETTABLE);
    return (fmi2Status)hc_set_reals(c, vr, n, values);
}

fmi2Status FMI2(GetInteger)(HC_REFERENCES, fmi2Integer values[])
{
    ENTER(GetInteger, COMPUTED);
    return (fmi2Status)hc_get_modes(c, vr, n, values);
}

/* Integers cannot be set; variables of the other types do not exist. */
#define NO_VARIABLE(function, type, values_type, allowed)                                                             \
    fmi2Status FMI2(function)(HC_REFERENCES, values_type values[])                                                    \
    {                                                                                                                 \
        ENTER(function, allowed);                                                                                     \
        (void)values;                                                                                                 \
        return (fmi2Status)hc_no_variable(c, type, vr, n);                                                            \
    }
NO_VARIABLE(SetInteger, "Integer", const fmi2Integer, DISCRETE)
NO_VARIABLE(GetBoolean, "Boolean", fmi2Boolean, COMPUTED)
NO_VARIABLE(SetBoolean, "Boolean", const fmi2Boolean, DISCRETE)
NO_VARIABLE(GetString, "String", fmi2String, COMPUTED)
NO_VARIABLE(SetString, "String", const fmi2String, DISCRETE)

/* ---- partial derivatives ---- */

fmi2Status FMI2(GetDirectionalDerivative)(HC_ARGUMENTS, const fmi2ValueReference unknowns[], size_t n_unknowns,
                                          const fmi2ValueReference knowns[], size_t n_knowns, const fmi2Real seed[],
                                          fmi2Real sensitivity[])
{
    ENTER(GetDirectionalDerivative, COMPUTED);
    return (fmi2Status)hc_partial_derivatives(c, 0, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

/* ---- Model Exchange ---- */

fmi2Status FMI2(EnterEventMode)(HC_ARGUMENTS)
{
    ENTER_ME(EnterEventMode, HC_EVENT | HC_CONTINUOUS_TIME);
    return (fmi2Status)hc_enter_event_mode(c);
}

fmi2Status FMI2(NewDiscreteStates)(HC_ARGUMENTS, fmi2EventInfo *info)
{
    int changed, status;
    double next;
    ENTER_ME(NewDiscreteStates, HC_EVENT);
    NOT_NULL(info);
    status = hc_update_discrete_states(c, &changed, &next);
    info->newDiscreteStatesNeeded = 0;
    info->terminateSimulation = 0;
    info->nominalsOfContinuousStatesChanged = 0;
    info->valuesOfContinuousStatesChanged = changed;
    info->nextEventTimeDefined = next < DBL_MAX;
    info->nextEventTime = next;
    return (fmi2Status)status;
}

fmi2Status FMI2(CompletedIntegratorStep)(HC_ARGUMENTS, fmi2Boolean no_return, fmi2Boolean *enter_event_mode,
                                         fmi2Boolean *terminate)
{
    ENTER(CompletedIntegratorStep, HC_CONTINUOUS_TIME);
    NOT_NULL(enter_event_mode);
    NOT_NULL(terminate);
    (void)no_return;
    *terminate = 0;
    return (fmi2Status)hc_completed_step(c, enter_event_mode);
}

/* ---- Co-Simulation ---- */

fmi2Status FMI2(SetRealInputDerivatives)(HC_REFERENCES, const fmi2Integer orders[], const fmi2Real values[])
{
    ENTER_CS(SetRealInputDerivatives, HC_INSTANTIATED | HC_INITIALIZATION | HC_STEP);
    (void)vr;
    (void)n;
    (void)orders;
    (void)values;
    return (fmi2Status)hc_not_supported(c, "derivatives of inputs: inputs are held over a step");
}

fmi2Status FMI2(GetRealOutputDerivatives)(HC_REFERENCES, const fmi2Integer orders[], fmi2Real values[])
{
    ENTER_CS(GetRealOutputDerivatives, HC_STEP | ENDED);
    return (fmi2Status)hc_output_derivatives(c, vr, orders, n, values);
}

fmi2Status FMI2(DoStep)(HC_ARGUMENTS, fmi2Real time, fmi2Real length, fmi2Boolean no_return)
{
    int event, early;
    ENTER(DoStep, HC_STEP);
    (void)no_return;
    return (fmi2Status)hc_do_step(c, time, length, &event, &early);
}

fmi2Status FMI2(CancelStep)(HC_ARGUMENTS)
{
    ENTER(CancelStep, 0); /* no step is ever in progress */
    return fmi2Error;
}

/* Status of the last step; asynchronous and discarded steps do not occur. */
fmi2Status FMI2(GetRealStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Real *value)
{
    ENTER_CS(GetRealStatus, HC_STEP | HC_TERMINATED);
    NOT_NULL(value);
    if (kind != fmi2LastSuccessfulTime)
        return (fmi2Status)hc_discard(c, "there is no such status");
    *value = c->value[0];
    return fmi2OK;
}

fmi2Status FMI2(GetBooleanStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Boolean *value)
{
    ENTER_CS(GetBooleanStatus, HC_STEP | HC_TERMINATED);
    NOT_NULL(value);
    if (kind != fmi2Terminated)
        return (fmi2Status)hc_discard(c, "there is no such status");
    *value = 0;
    return fmi2OK;
}

#define NO_STATUS(function, type)                                                                                     \
    fmi2Status FMI2(function)(HC_ARGUMENTS, const fmi2StatusKind kind, type *value)                                   \
    {                                                                                                                 \
        ENTER_CS(function, HC_STEP | HC_TERMINATED);                                                                  \
        (void)kind;                                                                                                   \
        NOT_NULL(value);                                                                                              \
        return (fmi2Status)hc_discard(c, "there is no such status: steps are not asynchronous");                      \
    }
NO_STATUS(GetStatus, fmi2Status)
NO_STATUS(GetIntegerStatus, fmi2Integer)
NO_STATUS(GetStringStatus, fmi2String)
