/* The functions of FMI 3.0 of a corrected FMU. Other variables than those of hc_around.h, and their types, are the inner
 * FMU's own. It has no clocks and no event mode in Co-Simulation, see hc_around_fmi3_values.c. What FMI 2.0 defines alike is
 * in hc_around_shared.h.
 */
#include "hc_inner_fmi3.h"

#include "hc_around_shared.h"

#include <float.h>
#include <stdlib.h>

static void emit(const hc_log_type *log, int status, const char *category, const char *message)
{
    ((fmi3LogMessageCallback)log->callback)(log->environment, (fmi3Status)status, category, message);
}

const char *FMI3(GetVersion)(void)
{
    return "3.0";
}

/* ---- instances ---- */

static hc_around *begin(int kind, fmi3String name, fmi3String token, fmi3String resources, const hc_log_type *log,
                        const char *function, char **place)
{
    char text[600];
    const char *wrong;
    hc_around *c = hc_around_new(log, function, kind, name, token);
    if (!c)
        return NULL;
    c->inner = calloc(1, sizeof *c->inner);
    wrong = c->inner ? hc_inner_load_3(c->inner, resources, hc_surroundings.inner_identifier, c->inner_kind, text,
                                       sizeof text)
                     : "no memory";
    *place = wrong ? NULL : hc_library_path(resources, "inner/resources/");
    if (!*place) {
        hc_log_message(log, HC_ERROR, function, "%s", wrong ? wrong : "no memory");
        release(c);
        return NULL;
    }
    return c;
}

static fmi3Instance made(hc_around *c, char *place)
{
    free(place);
    if (c->inner->component && hc_around_start(c) < HC_DISCARD)
        return c;
    release(c);
    return NULL;
}

static void inner_exchange(hc_around *c, fmi3String name, const char *place, fmi3Boolean visible, fmi3Boolean logging,
                           fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback)
{
    c->inner->component = c->inner->InstantiateModelExchange(name, hc_surroundings.inner_token, place, visible, logging,
                                                             environment, callback);
}

fmi3Instance FMI3(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
                                            fmi3Boolean visible, fmi3Boolean logging,
                                            fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback)
{
    const hc_log_type log = {3, "", environment, (void (*)(void))callback, emit, ~0u};
    char *place;
    hc_around *c =
        begin(HC_MODEL_EXCHANGE, name, token, resources, &log, "fmi3InstantiateModelExchange", &place);
    if (!c)
        return NULL;
    inner_exchange(c, name, place, visible, logging, environment, callback);
    return made(c, place);
}

fmi3Instance FMI3(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
                                           fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                           fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                           size_t n_intermediate, fmi3InstanceEnvironment environment,
                                           fmi3LogMessageCallback callback, fmi3IntermediateUpdateCallback update)
{
    const hc_log_type log = {3, "", environment, (void (*)(void))callback, emit, ~0u};
    char *place;
    hc_around *c = begin(HC_CO_SIMULATION, name, token, resources, &log, "fmi3InstantiateCoSimulation", &place);
    (void)event_mode;
    (void)early_return;
    (void)intermediate;
    (void)n_intermediate;
    (void)update;
    if (!c)
        return NULL;
    if (c->inner_kind == HC_MODEL_EXCHANGE)
        inner_exchange(c, name, place, visible, logging, environment, callback);
    else
        c->inner->component =
            c->inner->InstantiateCoSimulation(name, hc_surroundings.inner_token, place, visible, logging, false, false,
                                              NULL, 0, environment, callback, NULL);
    return made(c, place);
}

fmi3Status FMI3(EnterInitializationMode)(HC_ARGUMENTS, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                         fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    fmi3Status status;
    ENTER(EnterInitializationMode, HC_INSTANTIATED);
    if (hc_around_experiment(c, has_tolerance, tolerance, start, has_stop, stop))
        return fmi3Error;
    status = PASS(EnterInitializationMode, has_tolerance, tolerance, start, has_stop, stop);
    if (status < fmi3Discard)
        c->state = HC_INITIALIZATION;
    return status;
}

/* ---- events ---- */

fmi3Status FMI3(EnterEventMode)(HC_ARGUMENTS)
{
    ENTER(EnterEventMode, HC_CONTINUOUS_TIME);
    return (fmi3Status)hc_around_enter_event(c);
}

fmi3Status FMI3(EvaluateDiscreteStates)(HC_ARGUMENTS)
{
    ENTER(EvaluateDiscreteStates, HC_EVENT);
    return fmi3OK;
}

fmi3Status FMI3(UpdateDiscreteStates)(HC_ARGUMENTS, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                      fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                      fmi3Boolean *has_next, fmi3Float64 *next)
{
    hc_inner_event event = {0, 0, 0, 0, DBL_MAX};
    int status;
    ENTER(UpdateDiscreteStates, HC_EVENT);
    status = hc_around_update(c, &event);
    *need_update = event.again != 0;
    *terminate = event.terminate != 0;
    *nominals_changed = event.nominals_changed != 0;
    *states_changed = event.states_changed != 0;
    *has_next = event.next < DBL_MAX;
    *next = event.next;
    return (fmi3Status)status;
}

/* ---- Model Exchange ---- */

fmi3Status FMI3(CompletedIntegratorStep)(HC_ARGUMENTS, fmi3Boolean no_return, fmi3Boolean *enter_event_mode,
                                         fmi3Boolean *terminate)
{
    int event = 0, end = 0, status;
    ENTER(CompletedIntegratorStep, HC_CONTINUOUS_TIME);
    (void)no_return;
    status = hc_around_completed_step(c, &event, &end);
    *enter_event_mode = event != 0;
    *terminate = end != 0;
    return (fmi3Status)status;
}

fmi3Status FMI3(GetNumberOfEventIndicators)(HC_ARGUMENTS, size_t *n)
{
    ENTER(GetNumberOfEventIndicators, ANY);
    *n = (size_t)hc_surroundings.n_indicators;
    return fmi3OK;
}

fmi3Status FMI3(GetNumberOfContinuousStates)(HC_ARGUMENTS, size_t *n)
{
    ENTER(GetNumberOfContinuousStates, ANY);
    *n = (size_t)hc_surroundings.n_states + hc_around_continuous();
    return fmi3OK;
}

/* ---- Co-Simulation ---- */

fmi3Status FMI3(DoStep)(HC_ARGUMENTS, fmi3Float64 time, fmi3Float64 length, fmi3Boolean no_return, fmi3Boolean *event,
                        fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *last_time)
{
    int status;
    ENTER(DoStep, HC_STEP);
    (void)no_return;
    status = hc_around_step(c, time, length);
    *event = false;
    *terminate = c->ended != 0;
    *early = false;
    *last_time = c->t;
    return status == HC_DISCARD && c->ended ? fmi3OK : (fmi3Status)status;
}
