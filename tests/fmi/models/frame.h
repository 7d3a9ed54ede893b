/* FMI 3.0 for a model of a few equations: Model Exchange, and Co-Simulation by Euler's method with a fixed step.

   A model is a file that defines the following and then includes this one.
     N        number of variables, all Float64; variable 0 is the time
     KINDS    a letter for each: t time, f fixed parameter, a tunable parameter, u input, x state, y any other;
              1 and 2: input of the first and second clock, A and B: their outputs
     START    start values
     NX, X, R number of states, their value references, those of their derivatives
     NZ       number of event indicators
     STEP     internal step of Co-Simulation [s]; a communication step must be a multiple of it
     rates    computes the derivatives and all others of kind y
     zeros    computes the event indicators
     update   computes the discrete states and states after an event; may set m->next, m->ended
   If CLOCKS is defined, Co-Simulation may use Event Mode, and clocks are activated by the bits of m->active;
   clocked variables can be set and read while their clock is active, and in Initialization Mode.
   If PARTIALS is defined, partials computes directional derivatives: seeds and results by value reference.

   Each call is allowed in the states that FMI 3.0 section 2.3, 3.2 and 4.2 name; elsewhere it returns fmi3Error. */

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"

enum { INSTANTIATED = 1, INITIALIZATION = 2, EVENT = 4, CONTINUOUS = 8, STEPPING = 16, TERMINATED = 32 };

typedef struct {
    double v[N], next; /* time of the next time event */
    bool ended;
    int mode;
    bool exchange, events; /* whether Event Mode is used in Co-Simulation */
    unsigned active;       /* clocks */
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} model;

static void rates(model *m);
static void zeros(const model *m, double *z);
static void update(model *m);
#ifdef PARTIALS
static void partials(const model *m, const double *given, double *found);
#endif
static const unsigned X[], R[];
static const double START[];

static fmi3Status refused(model *m, const char *text)
{
    if (m->log) m->log(m->environment, fmi3Error, "logStatusError", text);
    return fmi3Error;
}

#define IN(modes, call) \
    model *m = (model *)instance; \
    do { if (!(m->mode & (modes))) return refused(m, call " is not allowed now"); } while (0)

const char *fmi3GetVersion(void) { return fmi3Version; }

static model *made(bool exchange, bool events, fmi3String token, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    if (strcmp(token, TOKEN) != 0) return NULL;
    model *m = (model *)calloc(1, sizeof(model));
    if (!m) return NULL;
    memcpy(m->v, START, sizeof m->v);
    m->next = INFINITY;
    m->mode = INSTANTIATED;
    m->exchange = exchange;
    m->events = events;
    m->environment = environment;
    m->log = log;
    return m;
}

fmi3Instance fmi3InstantiateModelExchange(
    fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean logging,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)path, (void)visible, (void)logging;
    return made(true, false, token, environment, log);
}

fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String path, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t count,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback intermediate)
{
    (void)name, (void)path, (void)visible, (void)logging, (void)early;
    (void)required, (void)count, (void)intermediate;
#ifdef CLOCKS
    return made(false, events, token, environment, log);
#else
    (void)events;
    return made(false, false, token, environment, log);
#endif
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t n, const fmi3String categories[])
{
    (void)instance, (void)on, (void)n, (void)categories;
    return fmi3OK;
}

fmi3Status fmi3EnterInitializationMode(
    fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start, fmi3Boolean has_stop,
    fmi3Float64 stop)
{
    IN(INSTANTIATED, "fmi3EnterInitializationMode");
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    m->v[0] = start;
    m->mode = INITIALIZATION;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance)
{
    IN(INITIALIZATION, "fmi3ExitInitializationMode");
    m->mode = m->exchange || m->events ? EVENT : STEPPING;
    if (m->mode == STEPPING) update(m);
    return fmi3OK;
}

fmi3Status fmi3EnterEventMode(fmi3Instance instance)
{
    IN(m->events ? STEPPING : CONTINUOUS, "fmi3EnterEventMode");
    m->mode = EVENT;
    return fmi3OK;
}

fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance)
{
    IN(EVENT, "fmi3EnterContinuousTimeMode");
    m->mode = CONTINUOUS;
    return fmi3OK;
}

fmi3Status fmi3Terminate(fmi3Instance instance)
{
    IN(EVENT | CONTINUOUS | STEPPING, "fmi3Terminate");
    m->mode = TERMINATED;
    return fmi3OK;
}

fmi3Status fmi3Reset(fmi3Instance instance)
{
    model *m = (model *)instance;
    memcpy(m->v, START, sizeof m->v);
    m->next = INFINITY;
    m->ended = false;
    m->active = 0;
    m->mode = INSTANTIATED;
    return fmi3OK;
}

/* ---- values ---- */

fmi3Status fmi3GetFloat64(
    fmi3Instance instance, const fmi3ValueReference of[], size_t n, fmi3Float64 values[], size_t count)
{
    IN(INITIALIZATION | EVENT | CONTINUOUS | STEPPING | TERMINATED, "fmi3GetFloat64");
    if (n != count) return refused(m, "fmi3GetFloat64: a number of values that does not fit");
    rates(m);
    for (size_t i = 0; i < n; i++) {
        if (of[i] >= N) return refused(m, "fmi3GetFloat64: unknown variable");
        const char kind = KINDS[of[i]];
        if ((kind == 'A' || kind == 'B') && m->mode != INITIALIZATION && !(m->active & (unsigned)(kind - '@')))
            return refused(m, "fmi3GetFloat64: the clock of this variable is not active");
        values[i] = m->v[of[i]];
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(
    fmi3Instance instance, const fmi3ValueReference of[], size_t n, const fmi3Float64 values[], size_t count)
{
    IN(INSTANTIATED | INITIALIZATION | EVENT | CONTINUOUS | STEPPING, "fmi3SetFloat64");
    if (n != count) return refused(m, "fmi3SetFloat64: a number of values that does not fit");
    for (size_t i = 0; i < n; i++) {
        const char kind = of[i] < N ? KINDS[of[i]] : '?';
        const int early = INSTANTIATED | INITIALIZATION;
        const bool may = kind == 'u' || ((kind == 'f' || kind == 'x') && (m->mode & early)) ||
                         (kind == 'a' && (m->mode & (early | EVENT | STEPPING))) ||
                         ((kind == '1' || kind == '2') && m->mode == EVENT && (m->active & (unsigned)(kind - '0')));
        if (!may) return refused(m, "fmi3SetFloat64: this variable cannot be set now");
        m->v[of[i]] = values[i];
    }
    return fmi3OK;
}

/* ---- Model Exchange ---- */

fmi3Status fmi3UpdateDiscreteStates(
    fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *ended, fmi3Boolean *nominals, fmi3Boolean *states,
    fmi3Boolean *has_next, fmi3Float64 *next)
{
    IN(EVENT, "fmi3UpdateDiscreteStates");
    double before[NX + 1];
    for (int i = 0; i < NX; i++) before[i] = m->v[X[i]];
    update(m);
    m->active = 0;
    *again = *nominals = *states = false;
    for (int i = 0; i < NX; i++) *states = *states || before[i] != m->v[X[i]];
    *ended = m->ended;
    *has_next = m->next < INFINITY;
    *next = m->next;
    return fmi3OK;
}

fmi3Status fmi3CompletedIntegratorStep(
    fmi3Instance instance, fmi3Boolean forget, fmi3Boolean *event, fmi3Boolean *ended)
{
    IN(CONTINUOUS, "fmi3CompletedIntegratorStep");
    (void)forget;
    *event = *ended = false;
    return fmi3OK;
}

fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time)
{
    IN(EVENT | CONTINUOUS, "fmi3SetTime");
    m->v[0] = time;
    return fmi3OK;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 x[], size_t n)
{
    IN(CONTINUOUS, "fmi3SetContinuousStates");
    if (n != NX) return refused(m, "fmi3SetContinuousStates: a number of states that does not fit");
    for (int i = 0; i < NX; i++) m->v[X[i]] = x[i];
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStates(fmi3Instance instance, fmi3Float64 x[], size_t n)
{
    IN(INITIALIZATION | EVENT | CONTINUOUS, "fmi3GetContinuousStates");
    if (n != NX) return refused(m, "fmi3GetContinuousStates: a number of states that does not fit");
    for (int i = 0; i < NX; i++) x[i] = m->v[X[i]];
    return fmi3OK;
}

fmi3Status fmi3GetContinuousStateDerivatives(fmi3Instance instance, fmi3Float64 slopes[], size_t n)
{
    IN(INITIALIZATION | EVENT | CONTINUOUS, "fmi3GetContinuousStateDerivatives");
    if (n != NX) return refused(m, "fmi3GetContinuousStateDerivatives: a number of states that does not fit");
    rates(m);
    for (int i = 0; i < NX; i++) slopes[i] = m->v[R[i]];
    return fmi3OK;
}

fmi3Status fmi3GetEventIndicators(fmi3Instance instance, fmi3Float64 z[], size_t n)
{
    IN(INITIALIZATION | EVENT | CONTINUOUS, "fmi3GetEventIndicators");
    if (n != NZ) return refused(m, "fmi3GetEventIndicators: a number of indicators that does not fit");
    rates(m);
    zeros(m, z);
    return fmi3OK;
}

fmi3Status fmi3GetNominalsOfContinuousStates(fmi3Instance instance, fmi3Float64 nominals[], size_t n)
{
    (void)instance;
    for (size_t i = 0; i < n; i++) nominals[i] = 1.0;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n)
{
    (void)instance;
    *n = NZ;
    return fmi3OK;
}

fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n)
{
    (void)instance;
    *n = NX;
    return fmi3OK;
}

fmi3Status fmi3GetDirectionalDerivative(
    fmi3Instance instance, const fmi3ValueReference of[], size_t n, const fmi3ValueReference by[], size_t n_by,
    const fmi3Float64 seed[], size_t n_seed, fmi3Float64 found[], size_t n_found)
{
#ifdef PARTIALS
    IN(INITIALIZATION | EVENT | CONTINUOUS, "fmi3GetDirectionalDerivative");
    double given[N] = {0}, result[N] = {0};
    if (n != n_found || n_by != n_seed) return refused(m, "fmi3GetDirectionalDerivative: numbers that do not fit");
    for (size_t i = 0; i < n_by; i++) given[by[i]] = seed[i];
    partials(m, given, result);
    for (size_t i = 0; i < n; i++) found[i] = result[of[i]];
    return fmi3OK;
#else
    (void)of, (void)n, (void)by, (void)n_by, (void)seed, (void)n_seed, (void)found, (void)n_found;
    return refused((model *)instance, "fmi3GetDirectionalDerivative: not implemented");
#endif
}

/* ---- Co-Simulation ---- */

fmi3Status fmi3DoStep(
    fmi3Instance instance, fmi3Float64 time, fmi3Float64 length, fmi3Boolean forget, fmi3Boolean *event,
    fmi3Boolean *ended, fmi3Boolean *early, fmi3Float64 *reached)
{
    IN(STEPPING, "fmi3DoStep");
    (void)forget;
    const double count = floor(length / STEP + 0.5);
    *event = *early = false;
    if (count < 1.0 || fabs(length - count * STEP) > 1e-9) return refused(m, "fmi3DoStep: not a multiple of the fixed step");
    double before[NZ + 1], after[NZ + 1];
    for (long k = 0; k < (long)count && !m->ended; k++) {
        double x[NX + 1];
        rates(m);
        zeros(m, before);
        for (int i = 0; i < NX; i++) x[i] = m->v[X[i]] + STEP * m->v[R[i]];
        for (int i = 0; i < NX; i++) m->v[X[i]] = x[i];
        m->v[0] = time + (double)(k + 1) * STEP;
        rates(m);
        zeros(m, after);
        bool due = m->v[0] >= m->next - 1e-12;
        for (int i = 0; i < NZ; i++) due = due || (before[i] > 0.0) != (after[i] > 0.0);
        if (due) update(m);
    }
    *ended = m->ended;
    *reached = m->v[0];
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    model *copy = *state ? (model *)*state : (model *)malloc(sizeof(model));
    if (!copy) return fmi3Error;
    *copy = *(model *)instance;
    *state = copy;
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    *(model *)instance = *(model *)state;
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}
