/* FMI 3.0 in terms of hc_component.h: which call is allowed in which state (FMI 3.0.2, sections 2.3, 3.2 and 4.2), and
 * the types of the standard.
 */
#include "hc_fmi3.h"

#include <float.h>
#include <stdio.h>

#include "hc_component.h"

enum {
    INITIALIZED = HC_EVENT | HC_CONTINUOUS_TIME | HC_STEP,
    ENDED = HC_TERMINATED | HC_FAILED,
    ANY = HC_INSTANTIATED | HC_INITIALIZATION | INITIALIZED | ENDED,
    COMPUTED = HC_INITIALIZATION | INITIALIZED | ENDED, /* where equations are active */
    SETTABLE = HC_INSTANTIATED | HC_INITIALIZATION | INITIALIZED,
    DISCRETE = HC_INSTANTIATED | HC_INITIALIZATION | HC_EVENT | HC_STEP
};

#define ENTER(function, allowed)                                                                                      \
    hc_component *c = instance;                                                                                       \
    if (!hc_enter(c, "fmi3" #function, allowed))                                                                      \
    return fmi3Error
#define ENTER_ME(function, allowed)                                                                                   \
    hc_component *c = instance;                                                                                       \
    if (!hc_enter_kind(c, "fmi3" #function, allowed, HC_MODEL_EXCHANGE))                                              \
    return fmi3Error
#define NOT_NULL(pointer)                                                                                             \
    if (hc_no_null(c, pointer, #pointer, 1))                                                                          \
    return fmi3Error

/* ---- life ---- */

static void emit(const hc_log_type *log, int status, const char *category, const char *message)
{
    char text[1200];
    size_t n = 0;
    for (; *message && n + 2 < sizeof text; message++) {
        text[n++] = *message;
        if (*message == '#') /* the sign of a value reference */
            text[n++] = '#';
    }
    text[n] = '\0';
    ((fmi3LogMessageCallback)log->callback)(log->environment, (fmi3Status)status, category, text);
}

static hc_log_type logger(fmi3Boolean logging, fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback)
{
    hc_log_type log = {3, "", NULL, NULL, emit, 0};
    log.environment = environment;
    log.callback = (void (*)(void))callback;
    log.categories = logging ? ~0u : 1u << HC_ERROR;
    return log;
}

const char *FMI3(GetVersion)(void)
{
    return "3.0";
}

fmi3Status FMI3(SetDebugLogging)(HC_ARGUMENTS, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    ENTER(SetDebugLogging, ANY);
    return (fmi3Status)hc_set_logging(c, on, 0, n, categories);
}

fmi3Instance FMI3(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
                                            fmi3Boolean visible, fmi3Boolean logging,
                                            fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback)
{
    const hc_log_type log = logger(logging, environment, callback);
    (void)resources;
    (void)visible;
    return hc_component_new(&log, "fmi3InstantiateModelExchange", HC_MODEL_EXCHANGE, name, token);
}

fmi3Instance FMI3(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
                                           fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                           fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                           size_t n_intermediate, fmi3InstanceEnvironment environment,
                                           fmi3LogMessageCallback callback, fmi3IntermediateUpdateCallback update)
{
    const hc_log_type log = logger(logging, environment, callback);
    hc_component *c;
    (void)resources;
    (void)visible;
    (void)intermediate; /* there is no intermediate update */
    (void)n_intermediate;
    (void)update;
    c = hc_component_new(&log, "fmi3InstantiateCoSimulation", HC_CO_SIMULATION, name, token);
    if (c) {
        c->event_mode_used = event_mode;
        c->early_return_allowed = early_return;
    }
    return c;
}

fmi3Instance FMI3(InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                 fmi3Boolean visible, fmi3Boolean logging,
                                                 fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback,
                                                 fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                 fmi3UnlockPreemptionCallback unlock)
{
    (void)name;
    (void)token;
    (void)resources;
    (void)visible;
    (void)logging;
    (void)update;
    (void)lock;
    (void)unlock;
    if (callback)
        callback(environment, fmi3Error, "logStatusError",
                 "fmi3InstantiateScheduledExecution: not supported; the FMU has Model Exchange and Co-Simulation");
    return NULL;
}

void FMI3(FreeInstance)(HC_ARGUMENTS)
{
    hc_component_free(instance);
}

fmi3Status FMI3(EnterInitializationMode)(HC_ARGUMENTS, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                         fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    ENTER(EnterInitializationMode, HC_INSTANTIATED);
    if (hc_set_experiment(c, has_tolerance, tolerance, start, has_stop, stop))
        return fmi3Error;
    c->state = HC_INITIALIZATION;
    return fmi3OK;
}

fmi3Status FMI3(ExitInitializationMode)(HC_ARGUMENTS)
{
    ENTER(ExitInitializationMode, HC_INITIALIZATION);
    return (fmi3Status)hc_exit_initialization(c);
}

fmi3Status FMI3(EnterEventMode)(HC_ARGUMENTS)
{
    ENTER(EnterEventMode, HC_CONTINUOUS_TIME | HC_STEP);
    return (fmi3Status)hc_enter_event_mode(c);
}

fmi3Status FMI3(Terminate)(HC_ARGUMENTS)
{
    ENTER(Terminate, INITIALIZED);
    c->state = HC_TERMINATED;
    return fmi3OK;
}

fmi3Status FMI3(Reset)(HC_ARGUMENTS)
{
    ENTER(Reset, ANY);
    return (fmi3Status)hc_reset(c);
}

fmi3Status FMI3(EnterConfigurationMode)(HC_ARGUMENTS)
{
    ENTER(EnterConfigurationMode, HC_INSTANTIATED | HC_EVENT | HC_STEP);
    return (fmi3Status)hc_not_supported(c, "the FMU has no structural parameters");
}

fmi3Status FMI3(ExitConfigurationMode)(HC_ARGUMENTS)
{
    ENTER(ExitConfigurationMode, 0);
    return fmi3Error;
}

/* ---- values ---- */

static int wrong_count(hc_component *c, size_t n, size_t n_values)
{
    if (n == n_values)
        return HC_DONE;
    return hc_fail(c, "%zu value references but %zu values; all variables are scalars", n, n_values);
}

fmi3Status FMI3(GetFloat64)(HC_REFERENCES, fmi3Float64 values[], size_t n_values)
{
    ENTER(GetFloat64, ANY);
    return wrong_count(c, n, n_values) ? fmi3Error : (fmi3Status)hc_get_reals(c, vr, n, values);
}

fmi3Status FMI3(SetFloat64)(HC_REFERENCES, const fmi3Float64 values[], size_t n_values)
{
    ENTER(SetFloat64, SETTABLE);
    return wrong_count(c, n, n_values) ? fmi3Error : (fmi3Status)hc_set_reals(c, vr, n, values);
}

fmi3Status FMI3(GetInt32)(HC_REFERENCES, fmi3Int32 values[], size_t n_values)
{
    ENTER(GetInt32, ANY);
    return wrong_count(c, n, n_values) ? fmi3Error : (fmi3Status)hc_get_modes(c, vr, n, values);
}

/* The types of which there are no variables, or (Int32) none to set. */
#define NO_GET(name, type)                                                                                            \
    fmi3Status FMI3(Get##name)(HC_REFERENCES, type values[], size_t n_values)                                         \
    {                                                                                                                 \
        ENTER(Get##name, ANY);                                                                                        \
        (void)values;                                                                                                 \
        (void)n_values;                                                                                               \
        return (fmi3Status)hc_no_variable(c, #name, vr, n);                                                           \
    }
#define NO_SET(name, type)                                                                                            \
    fmi3Status FMI3(Set##name)(HC_REFERENCES, const type values[], size_t n_values)                                   \
    {                                                                                                                 \
        ENTER(Set##name, DISCRETE);                                                                                   \
        (void)values;                                                                                                 \
        (void)n_values;                                                                                               \
        return (fmi3Status)hc_no_variable(c, #name, vr, n);                                                           \
    }
#define NEITHER(name, type) NO_GET(name, type) NO_SET(name, type)
NEITHER(Float32, fmi3Float32)
NEITHER(Int8, fmi3Int8)
NEITHER(UInt8, fmi3UInt8)
NEITHER(Int16, fmi3Int16)
NEITHER(UInt16, fmi3UInt16)
NO_SET(Int32, fmi3Int32)
NEITHER(UInt32, fmi3UInt32)
NEITHER(Int64, fmi3Int64)
NEITHER(UInt64, fmi3UInt64)
NEITHER(Boolean, fmi3Boolean)
NEITHER(String, fmi3String)

fmi3Status FMI3(GetBinary)(HC_REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values)
{
    ENTER(GetBinary, ANY);
    (void)sizes;
    (void)values;
    (void)n_values;
    return (fmi3Status)hc_no_variable(c, "Binary", vr, n);
}

fmi3Status FMI3(SetBinary)(HC_REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values)
{
    ENTER(SetBinary, DISCRETE);
    (void)sizes;
    (void)values;
    (void)n_values;
    return (fmi3Status)hc_no_variable(c, "Binary", vr, n);
}

/* ---- not supported ---- */

#define NO_CLOCKS(function)                                                                                           \
    ENTER(function, ANY);                                                                                             \
    (void)vr;                                                                                                         \
    (void)n;                                                                                                          \
    return (fmi3Status)hc_not_supported(c, "the FMU has no clocks")

fmi3Status FMI3(GetClock)(HC_REFERENCES, fmi3Clock values[])
{
    (void)values;
    NO_CLOCKS(GetClock);
}

fmi3Status FMI3(SetClock)(HC_REFERENCES, const fmi3Clock values[])
{
    (void)values;
    NO_CLOCKS(SetClock);
}

fmi3Status FMI3(GetIntervalDecimal)(HC_REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)intervals;
    (void)qualifiers;
    NO_CLOCKS(GetIntervalDecimal);
}

fmi3Status FMI3(GetIntervalFraction)(HC_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                     fmi3IntervalQualifier qualifiers[])
{
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    NO_CLOCKS(GetIntervalFraction);
}

fmi3Status FMI3(GetShiftDecimal)(HC_REFERENCES, fmi3Float64 shifts[])
{
    (void)shifts;
    NO_CLOCKS(GetShiftDecimal);
}

fmi3Status FMI3(GetShiftFraction)(HC_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)counters;
    (void)resolutions;
    NO_CLOCKS(GetShiftFraction);
}

fmi3Status FMI3(SetIntervalDecimal)(HC_REFERENCES, const fmi3Float64 intervals[])
{
    (void)intervals;
    NO_CLOCKS(SetIntervalDecimal);
}

fmi3Status FMI3(SetIntervalFraction)(HC_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)counters;
    (void)resolutions;
    NO_CLOCKS(SetIntervalFraction);
}

fmi3Status FMI3(SetShiftDecimal)(HC_REFERENCES, const fmi3Float64 shifts[])
{
    (void)shifts;
    NO_CLOCKS(SetShiftDecimal);
}

fmi3Status FMI3(SetShiftFraction)(HC_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)counters;
    (void)resolutions;
    NO_CLOCKS(SetShiftFraction);
}

fmi3Status FMI3(ActivateModelPartition)(HC_ARGUMENTS, fmi3ValueReference clock, fmi3Float64 time)
{
    ENTER(ActivateModelPartition, ANY);
    (void)clock;
    (void)time;
    return (fmi3Status)hc_not_supported(c, "Scheduled Execution");
}

fmi3Status FMI3(GetNumberOfVariableDependencies)(HC_ARGUMENTS, fmi3ValueReference vr, size_t *n)
{
    ENTER(GetNumberOfVariableDependencies, ANY);
    (void)vr;
    (void)n;
    return (fmi3Status)hc_not_supported(c, "dependencies per element; see modelDescription.xml");
}

fmi3Status FMI3(GetVariableDependencies)(HC_ARGUMENTS, fmi3ValueReference dependent, size_t elements[],
                                         fmi3ValueReference independents[], size_t independent_elements[],
                                         fmi3DependencyKind kinds[], size_t n)
{
    ENTER(GetVariableDependencies, ANY);
    (void)dependent;
    (void)elements;
    (void)independents;
    (void)independent_elements;
    (void)kinds;
    (void)n;
    return (fmi3Status)hc_not_supported(c, "dependencies per element; see modelDescription.xml");
}

fmi3Status FMI3(GetOutputDerivatives)(HC_REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
{
    ENTER(GetOutputDerivatives, HC_STEP | ENDED);
    (void)vr;
    (void)n;
    (void)orders;
    (void)values;
    (void)n_values;
    return (fmi3Status)hc_not_supported(c, "derivatives of outputs by time");
}

/* ---- the whole state ---- */

fmi3Status FMI3(GetFMUState)(HC_ARGUMENTS, fmi3FMUState *state)
{
    ENTER(GetFMUState, ANY);
    return (fmi3Status)hc_state_get(c, state);
}

fmi3Status FMI3(SetFMUState)(HC_ARGUMENTS, fmi3FMUState state)
{
    ENTER(SetFMUState, ANY);
    return (fmi3Status)hc_state_set(c, state);
}

fmi3Status FMI3(FreeFMUState)(HC_ARGUMENTS, fmi3FMUState *state)
{
    ENTER(FreeFMUState, ANY);
    return (fmi3Status)hc_state_free(c, state);
}

fmi3Status FMI3(SerializedFMUStateSize)(HC_ARGUMENTS, fmi3FMUState state, size_t *size)
{
    ENTER(SerializedFMUStateSize, ANY);
    return (fmi3Status)hc_state_size(c, state, size);
}

fmi3Status FMI3(SerializeFMUState)(HC_ARGUMENTS, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    ENTER(SerializeFMUState, ANY);
    return (fmi3Status)hc_state_write(c, state, bytes, size);
}

fmi3Status FMI3(DeserializeFMUState)(HC_ARGUMENTS, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    ENTER(DeserializeFMUState, ANY);
    return (fmi3Status)hc_state_read(c, bytes, size, state);
}

/* ---- partial derivatives ---- */

static fmi3Status partial_derivatives(hc_component *c, int adjoint, const fmi3ValueReference unknowns[],
                                      size_t n_unknowns, const fmi3ValueReference knowns[], size_t n_knowns,
                                      const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
                                      size_t n_sensitivity)
{
    const size_t expected_seed = adjoint ? n_unknowns : n_knowns, expected = adjoint ? n_knowns : n_unknowns;
    if (n_seed != expected_seed || n_sensitivity != expected)
        return (fmi3Status)hc_fail(c, "%zu seeds and %zu sensitivities where there must be %zu and %zu", n_seed,
                                   n_sensitivity, expected_seed, expected);
    return (fmi3Status)hc_partial_derivatives(c, adjoint, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

fmi3Status FMI3(GetDirectionalDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetDirectionalDerivative, COMPUTED);
    return partial_derivatives(c, 0, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status FMI3(GetAdjointDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetAdjointDerivative, COMPUTED);
    return partial_derivatives(c, 1, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

/* ---- events ---- */

fmi3Status FMI3(EvaluateDiscreteStates)(HC_ARGUMENTS)
{
    ENTER(EvaluateDiscreteStates, HC_EVENT);
    return fmi3OK; /* there are none to evaluate before they are updated */
}

fmi3Status FMI3(UpdateDiscreteStates)(HC_ARGUMENTS, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                      fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                      fmi3Boolean *has_next, fmi3Float64 *next)
{
    int changed, status;
    double at;
    ENTER(UpdateDiscreteStates, HC_EVENT);
    NOT_NULL(need_update);
    NOT_NULL(terminate);
    NOT_NULL(nominals_changed);
    NOT_NULL(states_changed);
    NOT_NULL(has_next);
    NOT_NULL(next);
    status = hc_update_discrete_states(c, &changed, &at);
    *need_update = *terminate = *nominals_changed = false;
    *states_changed = changed != 0;
    *has_next = at < DBL_MAX;
    *next = at;
    return (fmi3Status)status;
}

/* ---- Model Exchange ---- */

fmi3Status FMI3(EnterContinuousTimeMode)(HC_ARGUMENTS)
{
    ENTER_ME(EnterContinuousTimeMode, HC_EVENT);
    return (fmi3Status)hc_leave_event_mode(c, HC_CONTINUOUS_TIME);
}

fmi3Status FMI3(CompletedIntegratorStep)(HC_ARGUMENTS, fmi3Boolean no_return, fmi3Boolean *enter_event_mode,
                                         fmi3Boolean *terminate)
{
    int event = 0, status;
    ENTER(CompletedIntegratorStep, HC_CONTINUOUS_TIME);
    NOT_NULL(enter_event_mode);
    NOT_NULL(terminate);
    (void)no_return;
    status = hc_completed_step(c, &event);
    *enter_event_mode = event != 0;
    *terminate = false;
    return (fmi3Status)status;
}

fmi3Status FMI3(SetTime)(HC_ARGUMENTS, fmi3Float64 time)
{
    ENTER(SetTime, HC_CONTINUOUS_TIME);
    return (fmi3Status)hc_set_time(c, time);
}

fmi3Status FMI3(SetContinuousStates)(HC_ARGUMENTS, const fmi3Float64 states[], size_t n)
{
    ENTER(SetContinuousStates, HC_CONTINUOUS_TIME);
    return (fmi3Status)hc_set_states(c, states, n);
}

fmi3Status FMI3(GetContinuousStateDerivatives)(HC_ARGUMENTS, fmi3Float64 derivatives[], size_t n)
{
    ENTER_ME(GetContinuousStateDerivatives, COMPUTED);
    return (fmi3Status)hc_get_part(c, HC_DERIVATIVES, derivatives, n);
}

fmi3Status FMI3(GetEventIndicators)(HC_ARGUMENTS, fmi3Float64 indicators[], size_t n)
{
    ENTER_ME(GetEventIndicators, COMPUTED);
    return (fmi3Status)hc_get_part(c, HC_INDICATORS, indicators, n);
}

fmi3Status FMI3(GetContinuousStates)(HC_ARGUMENTS, fmi3Float64 states[], size_t n)
{
    ENTER_ME(GetContinuousStates, COMPUTED);
    return (fmi3Status)hc_get_part(c, HC_STATES, states, n);
}

fmi3Status FMI3(GetNominalsOfContinuousStates)(HC_ARGUMENTS, fmi3Float64 nominals[], size_t n)
{
    ENTER_ME(GetNominalsOfContinuousStates, COMPUTED);
    return (fmi3Status)hc_get_nominals(c, nominals, n);
}

fmi3Status FMI3(GetNumberOfEventIndicators)(HC_ARGUMENTS, size_t *n)
{
    ENTER_ME(GetNumberOfEventIndicators, ANY);
    NOT_NULL(n);
    *n = (size_t)c->model->n_friction;
    return fmi3OK;
}

fmi3Status FMI3(GetNumberOfContinuousStates)(HC_ARGUMENTS, size_t *n)
{
    ENTER_ME(GetNumberOfContinuousStates, ANY);
    NOT_NULL(n);
    *n = hc_n_continuous(c);
    return fmi3OK;
}

/* ---- Co-Simulation ---- */

fmi3Status FMI3(EnterStepMode)(HC_ARGUMENTS)
{
    hc_component *c = instance;
    if (!hc_enter_kind(c, "fmi3EnterStepMode", HC_EVENT, HC_CO_SIMULATION))
        return fmi3Error;
    return (fmi3Status)hc_leave_event_mode(c, HC_STEP);
}

fmi3Status FMI3(DoStep)(HC_ARGUMENTS, fmi3Float64 time, fmi3Float64 length, fmi3Boolean no_return, fmi3Boolean *event,
                        fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last_time)
{
    int event_here, early_here, status;
    ENTER(DoStep, HC_STEP);
    NOT_NULL(event);
    NOT_NULL(terminate);
    NOT_NULL(early);
    NOT_NULL(last_time);
    (void)no_return;
    status = hc_do_step(c, time, length, &event_here, &early_here);
    *event = event_here != 0;
    *terminate = false;
    *early = early_here != 0;
    *last_time = c->value[0];
    return (fmi3Status)status;
}
