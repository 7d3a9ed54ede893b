/* Drive an FMU of FMI 2 through all that it can do, for the sanitisers. Exit status 0 if all went as it must. */
#include "hc_description.h"
#include "hc_fmi2.h"
#include "hc_model.h"

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

static int messages;

static void count_message(fmi2ComponentEnvironment environment, fmi2String instance, fmi2Status status,
                          fmi2String category, fmi2String message, ...)
{
    (void)environment;
    (void)status;
    messages += strlen(instance) > 0 && strlen(category) > 0 && strlen(message) > 0;
}

static fmi2Component make(fmi2Type type)
{
    const fmi2CallbackFunctions functions = {count_message, NULL, NULL, NULL, NULL};
    fmi2Component c = fmi2Instantiate("one", type, hc_description.token, "", &functions, 0, 1);
    CHECK(c);
    return c;
}

static void run_co_simulation(void)
{
    fmi2Component c = make(fmi2CoSimulation);
    fmi2FMUstate state = NULL;
    const unsigned all = (unsigned)(1 + 2 * hc_model.n_states);
    double first = 0.0, second = 0.0, y;
    CHECK(fmi2SetupExperiment(c, 1, 1e-8, 0.0, 1, 5.0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    CHECK(fmi2GetFMUstate(c, &state) == fmi2OK);
    for (int turn = 0; turn < 2; turn++) {
        for (int k = 0; k < 50; k++) {
            CHECK(fmi2DoStep(c, 0.1 * k, 0.1, 1) == fmi2OK);
            for (unsigned vr = 0; vr < all; vr++) {
                CHECK(fmi2GetReal(c, &vr, 1, &y) == fmi2OK);
                *(turn ? &second : &first) += y;
            }
        }
        CHECK(fmi2DoStep(c, 5.0, 0.1, 1) == fmi2Error); /* beyond the stop time */
        CHECK(fmi2SetFMUstate(c, state) == fmi2OK);
    }
    CHECK(first == second);
    CHECK(fmi2FreeFMUstate(c, &state) == fmi2OK);
    CHECK(fmi2Terminate(c) == fmi2OK);
    fmi2FreeInstance(c);
}

static void run_model_exchange(void)
{
    const size_t n = (size_t)hc_model.n_states, m = (size_t)hc_model.n_friction;
    double *x = calloc(n + 1, sizeof *x), *dx = calloc(n + 1, sizeof *dx), *z = calloc(m + 1, sizeof *z);
    fmi2Component c = make(fmi2ModelExchange);
    fmi2EventInfo info;
    fmi2Boolean enter, terminate;
    CHECK(x && dx && z);
    CHECK(fmi2SetupExperiment(c, 0, 0.0, 0.0, 0, 0.0) == fmi2OK);
    CHECK(fmi2EnterInitializationMode(c) == fmi2OK);
    CHECK(fmi2ExitInitializationMode(c) == fmi2OK);
    CHECK(fmi2NewDiscreteStates(c, &info) == fmi2OK);
    CHECK(fmi2EnterContinuousTimeMode(c) == fmi2OK);
    for (int k = 0; k < 4000; k++) {
        CHECK(fmi2GetContinuousStates(c, x, n) == fmi2OK);
        CHECK(fmi2GetDerivatives(c, dx, n) == fmi2OK);
        for (size_t i = 0; i < n; i++)
            x[i] += 1e-3 * dx[i];
        CHECK(fmi2SetTime(c, 1e-3 * (k + 1)) == fmi2OK);
        CHECK(fmi2SetContinuousStates(c, x, n) == fmi2OK);
        CHECK(fmi2CompletedIntegratorStep(c, 1, &enter, &terminate) == fmi2OK);
        CHECK(fmi2GetEventIndicators(c, z, m) == fmi2OK);
        for (size_t i = 0; i < m; i++)
            enter |= z[i] <= 0.0;
        if (enter) {
            CHECK(fmi2EnterEventMode(c) == fmi2OK);
            CHECK(fmi2NewDiscreteStates(c, &info) == fmi2OK && !info.newDiscreteStatesNeeded);
            CHECK(fmi2EnterContinuousTimeMode(c) == fmi2OK);
        }
    }
    fmi2FreeInstance(c);
    free(x);
    free(dx);
    free(z);
}

int main(void)
{
    const unsigned none = 4000000000u;
    double y;
    for (int k = 0; k < 10000; k++)
        fmi2FreeInstance(make(k % 2 ? fmi2ModelExchange : fmi2CoSimulation));
    run_co_simulation();
    run_model_exchange();
    fmi2Component c = make(fmi2CoSimulation);
    CHECK(fmi2Terminate(c) == fmi2Error && fmi2Reset(c) == fmi2OK);
    CHECK(fmi2GetReal(c, &none, 1, &y) == fmi2Error && fmi2Reset(c) == fmi2OK);
    CHECK(fmi2SetReal(c, &none, 1, &y) == fmi2Error && fmi2Reset(c) == fmi2OK);
    CHECK(fmi2SetReal(c, NULL, 1, NULL) == fmi2Error && fmi2Reset(c) == fmi2OK);
    CHECK(fmi2DeSerializeFMUstate(c, NULL, 0, NULL) == fmi2Error);
    CHECK(messages >= 6);
    fmi2FreeInstance(c);
    fmi2FreeInstance(NULL);
    return 0;
}
