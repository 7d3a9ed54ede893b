/* Drive an FMU of FMI 3 through all that it can do, for the sanitisers: `fmi3_sanitised WHAT`, where WHAT is cycles, run,
 * misuse or threads. Exit status 0 if all went as it must.
 */
#include "hc_description.h"
#include "hc_fmi3.h"
#include "hc_model.h"

#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CHECK(truth)                                                                                                  \
    do                                                                                                                \
        if (!(truth)) {                                                                                               \
            fprintf(stderr, "line %d: %s\n", __LINE__, #truth);                                                       \
            exit(1);                                                                                                  \
        }                                                                                                             \
    while (0)

static void count_message(fmi3InstanceEnvironment environment, fmi3Status status, fmi3String category, fmi3String text)
{
    (void)status;
    if (environment)
        *(long *)environment += strlen(category) > 0 && strlen(text) > 0;
}

static fmi3Instance make(int model_exchange, bool events, long *messages)
{
    const char *token = hc_description.token;
    if (model_exchange)
        return fmi3InstantiateModelExchange("me", token, "", false, true, messages, count_message);
    return fmi3InstantiateCoSimulation("cs", token, NULL, false, true, events, events, NULL, 0, messages, count_message, NULL);
}

static void update(fmi3Instance instance)
{
    bool more = true, terminate, nominals, states, defined;
    double next;
    while (more)
        CHECK(fmi3UpdateDiscreteStates(instance, &more, &terminate, &nominals, &states, &defined, &next) == fmi3OK);
}

static void cycles(void)
{
    for (int k = 0; k < 10000; k++) {
        fmi3Instance instance = make(k % 2, false, NULL);
        fmi3FMUState state = NULL;
        CHECK(instance);
        if (k % 3 == 0) {
            CHECK(fmi3GetFMUState(instance, &state) == fmi3OK);
            CHECK(fmi3FreeFMUState(instance, &state) == fmi3OK && !state);
        }
        CHECK(k % 5 || !fmi3InstantiateModelExchange("x", "{other}", "", false, false, NULL, NULL));
        fmi3FreeInstance(instance);
    }
}

static double input_at(int k, int i)
{
    return 0.5 + 0.3 * sin(0.37 * k + i);
}

/* Co-Simulation with inputs that jump, a state saved and restored on the way; the sum of what was seen. */
static double run_co_simulation(bool events)
{
    fmi3Instance instance = make(0, events, NULL);
    fmi3FMUState state = NULL;
    double sum = 0.0, at_save = 0.0, t = 0.0, y;
    bool event, terminate, early;
    const fmi3ValueReference first_input = (fmi3ValueReference)(2 * hc_model.n_states + 1);
    CHECK(instance);
    CHECK(fmi3EnterInitializationMode(instance, true, 1e-7, 0.0, true, 4.0) == fmi3OK);
    CHECK(fmi3ExitInitializationMode(instance) == fmi3OK);
    if (events) {
        update(instance);
        CHECK(fmi3EnterStepMode(instance) == fmi3OK);
    }
    for (int k = 0; k < 400; k++) {
        const double end = 0.01 * (k + 1);
        for (int i = 0; i < hc_model.n_inputs && k % 9 < 3; i++) {
            const fmi3ValueReference vr = first_input + (fmi3ValueReference)i;
            const double u = input_at(k, i);
            CHECK(fmi3SetFloat64(instance, &vr, 1, &u, 1) == fmi3OK);
        }
        while (t < end) {
            CHECK(fmi3DoStep(instance, t, end - t, true, &event, &terminate, &early, &t) == fmi3OK);
            CHECK(events || !early);
            if (event) {
                CHECK(fmi3EnterEventMode(instance) == fmi3OK);
                update(instance);
                CHECK(fmi3EnterStepMode(instance) == fmi3OK);
            }
        }
        for (fmi3ValueReference vr = 0; vr < first_input; vr++) {
            CHECK(fmi3GetFloat64(instance, &vr, 1, &y, 1) == fmi3OK);
            sum += y;
        }
        if (k == 200) { /* save, and go on as another instance with these bytes */
            size_t size;
            unsigned char *bytes;
            CHECK(fmi3GetFMUState(instance, &state) == fmi3OK);
            CHECK(fmi3SerializedFMUStateSize(instance, state, &size) == fmi3OK);
            bytes = malloc(size);
            CHECK(bytes && fmi3SerializeFMUState(instance, state, bytes, size) == fmi3OK);
            CHECK(fmi3FreeFMUState(instance, &state) == fmi3OK);
            fmi3FreeInstance(instance);
            instance = make(0, events, NULL);
            CHECK(instance && fmi3DeserializeFMUState(instance, bytes, size, &state) == fmi3OK);
            CHECK(fmi3SetFMUState(instance, state) == fmi3OK);
            free(bytes);
            at_save = sum;
        }
    }
    CHECK(sum != at_save);
    CHECK(fmi3SetFMUState(instance, state) == fmi3OK);
    CHECK(fmi3FreeFMUState(instance, &state) == fmi3OK);
    CHECK(fmi3Terminate(instance) == fmi3OK);
    fmi3FreeInstance(instance);
    return sum;
}

/* Model Exchange with Euler's method; events where an indicator changes its sign. */
static void run_model_exchange(void)
{
    const size_t n = (size_t)hc_model.n_states, m = (size_t)hc_model.n_friction;
    double *x = calloc(n + 1, sizeof *x), *dx = calloc(n + 1, sizeof *dx), *z = calloc(2 * m + 1, sizeof *z);
    fmi3Instance instance = make(1, false, NULL);
    bool enter, terminate;
    CHECK(instance && x && dx && z);
    CHECK(fmi3EnterInitializationMode(instance, false, 0.0, 0.0, false, 0.0) == fmi3OK);
    CHECK(fmi3ExitInitializationMode(instance) == fmi3OK);
    update(instance);
    CHECK(fmi3EnterContinuousTimeMode(instance) == fmi3OK);
    CHECK(fmi3GetEventIndicators(instance, z + m, m) == fmi3OK);
    for (int k = 0; k < 4000; k++) {
        CHECK(fmi3GetContinuousStates(instance, x, n) == fmi3OK);
        CHECK(fmi3GetContinuousStateDerivatives(instance, dx, n) == fmi3OK);
        for (size_t i = 0; i < n; i++)
            x[i] += 1e-3 * dx[i];
        CHECK(fmi3SetTime(instance, 1e-3 * (k + 1)) == fmi3OK);
        CHECK(fmi3SetContinuousStates(instance, x, n) == fmi3OK);
        CHECK(fmi3CompletedIntegratorStep(instance, true, &enter, &terminate) == fmi3OK);
        memcpy(z, z + m, m * sizeof *z);
        CHECK(fmi3GetEventIndicators(instance, z + m, m) == fmi3OK);
        for (size_t i = 0; i < m; i++)
            enter |= z[i] > 0.0 && z[m + i] <= 0.0;
        if (enter) {
            CHECK(fmi3EnterEventMode(instance) == fmi3OK);
            update(instance);
            CHECK(fmi3EnterContinuousTimeMode(instance) == fmi3OK);
            CHECK(fmi3GetEventIndicators(instance, z + m, m) == fmi3OK);
            for (size_t i = 0; i < m; i++)
                CHECK(z[m + i] > 0.0);
        }
    }
    fmi3FreeInstance(instance);
    free(x);
    free(dx);
    free(z);
}

static unsigned random_state = 1;

static unsigned pick(unsigned n)
{
    random_state ^= random_state << 13;
    random_state ^= random_state >> 17;
    random_state ^= random_state << 5;
    return random_state % n;
}

static double some_number(void)
{
    const double numbers[] = {0.0, 0.1, -1.0, NAN, INFINITY, -INFINITY, 1e300, 1e-300, 0.01, 1.0};
    return numbers[pick(10)];
}

/* Calls in any order, with any arguments that do not lie about the length of an array. */
static void misuse(void)
{
    double values[64], seeds[64];
    fmi3ValueReference vr[64];
    unsigned char bytes[4096] = {0};
    for (int round = 0; round < 300; round++) {
        long messages = 0;
        const int model_exchange = (int)pick(2);
        fmi3Instance instance = make(model_exchange, pick(2), &messages);
        fmi3FMUState state = NULL, kept = NULL;
        CHECK(instance);
        for (int call = 0; call < 200; call++) {
            const size_t n = pick(40);
            const bool no_pointer = pick(20) == 0;
            long before = messages;
            size_t size = 0, count;
            bool a, b, c, d, e;
            double at;
            int status = fmi3OK;
            for (size_t i = 0; i < 64; i++) {
                vr[i] = pick(50) ? pick(60) : 4000000000u;
                values[i] = some_number();
                seeds[i] = some_number();
            }
            switch (pick(30)) {
            case 0: status = fmi3EnterInitializationMode(instance, pick(2), some_number(), some_number(), pick(2), some_number()); break;
            case 1: status = fmi3ExitInitializationMode(instance); break;
            case 2: status = fmi3UpdateDiscreteStates(instance, &a, &b, &c, &d, &e, no_pointer ? NULL : &at); break;
            case 3: status = fmi3EnterContinuousTimeMode(instance); break;
            case 4: status = fmi3EnterStepMode(instance); break;
            case 5: status = fmi3EnterEventMode(instance); break;
            case 6: status = fmi3GetFloat64(instance, no_pointer ? NULL : vr, n, values, n); break;
            case 7: status = fmi3SetFloat64(instance, vr, n, no_pointer ? NULL : values, n); break;
            case 8: status = fmi3SetFloat64(instance, vr, 1, values, 1); break;
            case 9: status = fmi3GetInt32(instance, vr, 1, (fmi3Int32 *)values, 1); break;
            case 10: status = fmi3SetTime(instance, some_number()); break;
            case 11: status = fmi3SetContinuousStates(instance, no_pointer ? NULL : values, pick(3) ? (size_t)hc_model.n_states : n); break;
            case 12: status = fmi3GetContinuousStateDerivatives(instance, values, pick(3) ? (size_t)hc_model.n_states : n); break;
            case 13: status = fmi3GetEventIndicators(instance, values, pick(3) ? (size_t)hc_model.n_friction : n); break;
            case 14: status = fmi3DoStep(instance, pick(4) ? 0.0 : some_number(), some_number(), true, &a, &b, &c, no_pointer ? NULL : &at); break;
            case 15: status = fmi3GetDirectionalDerivative(instance, vr, n, vr + 1, n, seeds, n, no_pointer ? NULL : values, n); break;
            case 16: status = fmi3GetAdjointDerivative(instance, vr, 2, vr + 2, 2, seeds, 2, values, 2); break;
            case 17: status = fmi3GetFMUState(instance, no_pointer ? NULL : &state); break;
            case 18: status = fmi3SetFMUState(instance, no_pointer ? NULL : state); break;
            case 19: status = fmi3FreeFMUState(instance, &state); break;
            case 20:
                status = fmi3SerializedFMUStateSize(instance, state, &size);
                if (status == fmi3OK && size <= sizeof bytes)
                    status = fmi3SerializeFMUState(instance, state, bytes, pick(4) ? size : size - 1);
                break;
            case 21:
                bytes[pick(sizeof bytes)] ^= (unsigned char)pick(2);
                size = 40 + 8 * pick(100);
                status = fmi3DeserializeFMUState(instance, bytes, pick(2) ? size : pick(sizeof bytes), &kept);
                break;
            case 22: status = fmi3Terminate(instance); break;
            case 23: status = fmi3GetContinuousStates(instance, values, (size_t)hc_model.n_states); break;
            case 24: status = fmi3CompletedIntegratorStep(instance, true, &a, &b); break;
            case 25: status = fmi3GetNumberOfEventIndicators(instance, no_pointer ? NULL : &count); break;
            case 26: status = fmi3GetString(instance, vr, n, (fmi3String *)values, n); break;
            case 27: status = fmi3GetClock(instance, vr, n, NULL); break;
            default: status = fmi3Reset(instance); break;
            }
            CHECK(status == fmi3OK || messages > before);
            CHECK(status <= fmi3Error);
            if (status == fmi3Error && pick(2))
                CHECK(fmi3Reset(instance) == fmi3OK);
        }
        fmi3FreeFMUState(instance, &state);
        fmi3FreeFMUState(instance, &kept);
        fmi3FreeInstance(instance);
    }
}

static void *thread(void *sum)
{
    *(double *)sum = run_co_simulation(false);
    return NULL;
}

static void threads(void)
{
    pthread_t thread_of[8];
    double sum[8];
    for (int i = 0; i < 8; i++)
        CHECK(pthread_create(thread_of + i, NULL, thread, sum + i) == 0);
    for (int i = 0; i < 8; i++) {
        CHECK(pthread_join(thread_of[i], NULL) == 0);
        CHECK(sum[i] == sum[0]);
    }
    CHECK(sum[0] == run_co_simulation(false));
}

int main(int argc, char **argv)
{
    const char *what = argc > 1 ? argv[1] : "";
    if (strcmp(what, "cycles") == 0)
        cycles();
    else if (strcmp(what, "misuse") == 0)
        misuse();
    else if (strcmp(what, "threads") == 0)
        threads();
    else {
        run_co_simulation(false);
        run_co_simulation(true);
        run_model_exchange();
    }
    return 0;
}
