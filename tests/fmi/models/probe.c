/* An FMU for tests: FMI 2 and 3 for Co-Simulation in one library, well behaved or as ill as a test asks for.

   x' = -k x + u (u counts while "on" is true), solved exactly over a step in which the inputs hold.
   Every variable is a run of slots that begins at its value reference; the names stand in probe.py.
   Calls are written to the file of the environment variable PROBE_LOG, one word each. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2FunctionTypes.h"
#include "fmi3FunctionTypes.h"

#define EXPORT __attribute__((visibility("default")))

enum {
    U, MODE, ON, V, BYTE = V + 3, GEAR,
    X = 10, Z, STEPS, ECHO, OFF, W, SINGLE = W + 3, SUM,
    K = 20, GAIN, TROUBLE, AT, X0, M, STALE = M + 4, STRICT, FOLLOW,
    SIZE = 38, SLOTS = 40
};
enum { NONE, ERROR, DISCARD, CRASH, HANG, EXIT, FATAL, END, EARLY, PRINT, NOT_READY, LAST };

typedef struct {
    double slot[SLOTS];
    double time;
    int set; /* since the last step */
    int configuring, filtered;
    const fmi2CallbackFunctions *callbacks;
    fmi3LogMessageCallback log;
    void *environment;
} Model;

static int instances;

static void called(const char *what)
{
    const char *path = getenv("PROBE_LOG");
    FILE *file = path ? fopen(path, "a") : NULL;
    if (file) {
        fprintf(file, "%s\n", what);
        fclose(file);
    }
}

static void say(Model *m, int status, const char *text, double number)
{
    if (m->callbacks) {
        m->callbacks->logger(m->callbacks->componentEnvironment, "probe", (fmi2Status)status,
                             "logStatusError", "%s %g", text, number);
    } else if (!m->filtered) { /* as FMUs whose messages have no category */
        char line[200];
        snprintf(line, sizeof line, "%s %g", text, number);
        m->log(m->environment, (fmi3Status)status, "logStatusError", line);
    }
}

static size_t length(const Model *m, unsigned reference)
{
    return reference == V || reference == W ? (size_t)m->slot[SIZE] : reference == M ? 4 : 1;
}

static void compute(Model *m)
{
    double *s = m->slot;
    s[Z] = s[X] + s[GAIN] * s[U];
    s[ECHO] = 2 * s[MODE];
    s[OFF] = s[ON] == 0;
    for (int i = 0; i < 3; i++) s[W + i] = s[V + i] * s[M + i];
    s[SINGLE] = s[X];
    s[SUM] = s[BYTE] + s[GEAR];
}

static void start_values(Model *m)
{
    memset(m->slot, 0, sizeof m->slot);
    m->slot[ON] = m->slot[X0] = 1;
    m->slot[K] = 2;
    m->slot[GAIN] = 0.5;
    m->slot[AT] = 0.3;
    m->slot[GEAR] = 1;
    m->slot[SIZE] = 3;
    for (int i = 0; i < 4; i++) m->slot[M + i] = i + 1;
}

static Model *create(void)
{
#ifdef ONCE
    if (instances) return NULL;
#endif
    instances++;
    Model *m = calloc(1, sizeof *m);
    start_values(m);
    called("instantiate");
    return m;
}

static void release(Model *m)
{
    instances--;
    called("free");
    free(m);
}

static int initialise(Model *m)
{
    called("initialise");
    if (m->slot[TROUBLE] == NOT_READY) {
        say(m, 3, "cannot begin with trouble", m->slot[TROUBLE]);
        return 3;
    }
    m->slot[X] = m->slot[FOLLOW] != 0 ? m->slot[U] : m->slot[X0];
    m->set = 0;
    compute(m);
    return 0;
}

static int step(Model *m, double t, double h, int *ended, double *reached)
{
    double *s = m->slot;
    int trouble = t + h > s[AT] + 1e-9 ? (int)s[TROUBLE] : NONE;
    char line[60];
    snprintf(line, sizeof line, "step %.6g", t);
    called(line);
    *ended = 0;
    *reached = t + h;
    m->set = 0;
    if (fabs(t - m->time) > 1e-9) {
        say(m, 3, "the time is not", t);
        return 3;
    }
    switch (trouble) {
    case ERROR: say(m, 3, "the tank is empty, level", -1.5); return 3;
    case DISCARD: *reached = t; say(m, 2, "no solution for u =", s[U]); return 2;
    case CRASH: *(volatile int *)(size_t)m->set = 1; break;
    case HANG: for (;;) called("hang");
    case EXIT: exit(3);
    case FATAL: say(m, 4, "memory is gone", 0); return 4;
    case END: *ended = 1; *reached = t; return 2;
    case EARLY: *reached = t + h / 2; return 2;
    case PRINT: printf("{\"result\": [0]}\n"); fflush(stdout); break;
    default: break;
    }
    double decay = exp(-s[K] * h);
    s[X] = decay * s[X] + (1 - decay) / s[K] * (s[ON] != 0 ? s[U] : 0);
    s[STEPS] += 1;
    m->time = t + h;
    compute(m);
    *ended = trouble == LAST;
    return *ended ? 2 : 0;
}

static int read(Model *m, const unsigned *references, size_t n, double *values)
{
    if (m->slot[STRICT] != 0 && m->set) {
        say(m, 3, "nothing may be read between set and step, slot", references[0]);
        return 3;
    }
    if (m->slot[STALE] == 0) compute(m);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < length(m, references[i]); j++) *values++ = m->slot[references[i] + j];
    return 0;
}

static int write(Model *m, const unsigned *references, size_t n, const double *values)
{
    for (size_t i = 0; i < n; i++) {
        if (references[i] == SIZE && !m->configuring) {
            say(m, 3, "a size is set outside of Configuration Mode", *values);
            return 3;
        }
        for (size_t j = 0; j < length(m, references[i]); j++) m->slot[references[i] + j] = *values++;
    }
    m->set = 1;
    return 0;
}

static Model *copy(const Model *m)
{
    Model *kept = malloc(sizeof *kept);
    *kept = *m;
    return kept;
}

/* --- FMI 2 --- */

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                     const fmi2CallbackFunctions *callbacks, fmi2Boolean visible,
                                     fmi2Boolean logging)
{
    (void)name, (void)type, (void)guid, (void)resources, (void)visible, (void)logging;
    Model *m = create();
    if (m) m->callbacks = callbacks;
    return m;
}

EXPORT void fmi2FreeInstance(fmi2Component c) { release(c); }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n, const fmi2String names[])
{
    (void)c, (void)on, (void)n, (void)names;
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                      fmi2Real start, fmi2Boolean has_stop, fmi2Real stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((Model *)c)->time = start;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) { return c ? fmi2OK : fmi2Error; }
EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) { return (fmi2Status)initialise(c); }
EXPORT fmi2Status fmi2Terminate(fmi2Component c) { called("terminate"); return c ? fmi2OK : fmi2Error; }
EXPORT fmi2Status fmi2Reset(fmi2Component c) { called("reset"); start_values(c); return fmi2OK; }

static double last_time;
static int last_end;

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real t, fmi2Real h, fmi2Boolean no_return)
{
    (void)no_return;
    return (fmi2Status)step(c, t, h, &last_end, &last_time);
}

EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Real *value)
{
    (void)c, (void)kind;
    *value = last_time;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind kind, fmi2Boolean *value)
{
    (void)c, (void)kind;
    *value = last_end;
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    called("save");
    *state = copy(c);
    return fmi2OK;
}

EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate state)
{
    called("restore");
    *(Model *)c = *(Model *)state;
    return fmi2OK;
}

EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *state)
{
    (void)c;
    called("drop");
    free(*state);
    *state = NULL;
    return fmi2OK;
}

#define ACCESS2(Name, type)                                                                               \
    EXPORT fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference r[], size_t n, type v[])    \
    {                                                                                                     \
        double values[SLOTS];                                                                             \
        int status = read(c, r, n, values);                                                               \
        for (size_t i = 0; i < n && !status; i++) v[i] = (type)values[i];                                 \
        return (fmi2Status)status;                                                                        \
    }                                                                                                     \
    EXPORT fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference r[], size_t n,              \
                                    const type v[])                                                       \
    {                                                                                                     \
        double values[SLOTS];                                                                             \
        for (size_t i = 0; i < n; i++) values[i] = (double)v[i];                                          \
        return (fmi2Status)write(c, r, n, values);                                                        \
    }
ACCESS2(Real, fmi2Real)
ACCESS2(Integer, fmi2Integer)
ACCESS2(Boolean, fmi2Boolean)

/* --- FMI 3 --- */

EXPORT fmi3Instance fmi3InstantiateCoSimulation(
    fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logging,
    fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t n,
    fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)events, (void)early;
    (void)required, (void)n, (void)update;
    Model *m = create();
    if (m) {
        m->log = log;
        m->environment = environment;
    }
    return m;
}

EXPORT void fmi3FreeInstance(fmi3Instance c) { release(c); }

EXPORT fmi3Status fmi3SetDebugLogging(fmi3Instance c, fmi3Boolean on, size_t n, const fmi3String names[])
{
    (void)names;
    ((Model *)c)->filtered = !on || n > 0;
    return fmi3OK;
}

EXPORT fmi3Status fmi3EnterInitializationMode(fmi3Instance c, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                              fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop;
    ((Model *)c)->time = start;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitInitializationMode(fmi3Instance c) { return (fmi3Status)initialise(c); }
EXPORT fmi3Status fmi3Terminate(fmi3Instance c) { called("terminate"); return c ? fmi3OK : fmi3Error; }
EXPORT fmi3Status fmi3Reset(fmi3Instance c) { called("reset"); start_values(c); return fmi3OK; }

EXPORT fmi3Status fmi3DoStep(fmi3Instance c, fmi3Float64 t, fmi3Float64 h, fmi3Boolean no_return,
                             fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early, fmi3Float64 *reached)
{
    (void)no_return;
    int ended, status = step(c, t, h, &ended, reached);
    *event = false;
    *terminate = ended != 0;
    *early = status == 2 && *reached > t;
    return (ended || *early) ? fmi3OK : (fmi3Status)status;
}

EXPORT fmi3Status fmi3EnterConfigurationMode(fmi3Instance c)
{
    ((Model *)c)->configuring = 1;
    return fmi3OK;
}

EXPORT fmi3Status fmi3ExitConfigurationMode(fmi3Instance c)
{
    ((Model *)c)->configuring = 0;
    return fmi3OK;
}

EXPORT fmi3Status fmi3GetFMUState(fmi3Instance c, fmi3FMUState *state)
{
    called("save");
    *state = copy(c);
    return fmi3OK;
}

EXPORT fmi3Status fmi3SetFMUState(fmi3Instance c, fmi3FMUState state)
{
    called("restore");
    *(Model *)c = *(Model *)state;
    return fmi3OK;
}

EXPORT fmi3Status fmi3FreeFMUState(fmi3Instance c, fmi3FMUState *state)
{
    (void)c;
    called("drop");
    free(*state);
    *state = NULL;
    return fmi3OK;
}

#define ACCESS3(Name)                                                                                     \
    EXPORT fmi3Status fmi3Get##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n,               \
                                    fmi3##Name v[], size_t size)                                          \
    {                                                                                                     \
        double values[SLOTS];                                                                             \
        int status = read(c, r, n, values);                                                               \
        for (size_t i = 0; i < size && !status; i++) v[i] = (fmi3##Name)values[i];                        \
        return (fmi3Status)status;                                                                        \
    }                                                                                                     \
    EXPORT fmi3Status fmi3Set##Name(fmi3Instance c, const fmi3ValueReference r[], size_t n,               \
                                    const fmi3##Name v[], size_t size)                                    \
    {                                                                                                     \
        double values[SLOTS];                                                                             \
        for (size_t i = 0; i < size; i++) values[i] = (double)v[i];                                       \
        return (fmi3Status)write(c, r, n, values);                                                        \
    }
ACCESS3(Float64)
ACCESS3(Float32)
ACCESS3(Int32)
ACCESS3(Int64)
ACCESS3(UInt8)
ACCESS3(UInt64)
ACCESS3(Boolean)
