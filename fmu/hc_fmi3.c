/* FMI 3.0 in terms of hc_instance.h: which call is allowed in which state (FMI 3.0.2, sections 2.3, 3.2 and 4.2), and
 * the types of the standard. This file has instances, modes and time; hc_fmi3_values.c has values.
 */
#include "hc_fmi3.h"

#include "hc_table.h"

#include <float.h>

HC_TABLE(HC_FUNCTION)

/* ---- instances and modes ---- */

static void emit(const hc_log_type *log, int status, const char *category, const char *message)
{
    char text[1200];
    size_t n = 0;
    for (; *message && n + 2 < sizeof text; message++) {
        text[n++] = *message;
        if (*message == '#') /* start of a value reference */
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

fmi3Instance FMI3(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
                                            fmi3Boolean visible, fmi3Boolean logging,
                                            fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback)
{
    const hc_log_type log = logger(logging, environment, callback);
    (void)resources;
    (void)visible;
    return hc_instance_new(&log, "fmi3InstantiateModelExchange", HC_MODEL_EXCHANGE, name, token);
}

/* FMI 3.0.2, section 4.2.2.4: nothing can be set, all can be read; a step of the solver has ended. */
static int intermediate_update(hc_instance *c, int can_return)
{
    fmi3Boolean requested = false;
    fmi3Float64 until = c->value[0];
    ((fmi3IntermediateUpdateCallback)c->intermediate)(c->log.environment, c->value[0], false, true, true,
                                                      can_return != 0, &requested, &until);
    return can_return && requested; /* at once, as is allowed where the importer names a later time */
}

fmi3Instance FMI3(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
                                           fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                           fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                           size_t n_intermediate, fmi3InstanceEnvironment environment,
                                           fmi3LogMessageCallback callback, fmi3IntermediateUpdateCallback update)
{
    const hc_log_type log = logger(logging, environment, callback);
    hc_instance *c;
    (void)resources;
    (void)visible;
    (void)intermediate; /* all variables can be read then */
    (void)n_intermediate;
    c = hc_instance_new(&log, "fmi3InstantiateCoSimulation", HC_CO_SIMULATION, name, token);
    if (c) {
        c->event_mode_used = event_mode;
        c->early_return_allowed = early_return;
        c->intermediate = (void (*)(void))update;
        c->update = intermediate_update;
    }
    return c;
}

void FMI3(FreeInstance)(HC_ARGUMENTS)
{
    hc_instance_free(instance);
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

fmi3Status FMI3(EnterEventMode)(HC_ARGUMENTS)
{
    ENTER(EnterEventMode, HC_CONTINUOUS_TIME | HC_STEP);
    return (fmi3Status)hc_enter_event_mode(c);
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

/* ---- events ---- */

fmi3Status FMI3(EvaluateDiscreteStates)(HC_ARGUMENTS)
{
    ENTER(EvaluateDiscreteStates, HC_EVENT);
    return fmi3OK; /* nothing to evaluate before the update */
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
    ENTER_CS(EnterStepMode, HC_EVENT);
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
