/* Private to the runtime: the calls of FMI 2.0 to the FMU inside a corrected FMU. */
#ifndef HC_INNER_FMI2_H
#define HC_INNER_FMI2_H

#include "hc_fmi2.h"
#include "hc_inner.h"

/* X(function) for those that every FMU has, for those of Model Exchange and for those of Co-Simulation. */
#define HC_FMI2_COMMON(X)                                                                                             \
    X(SetDebugLogging) X(Instantiate) X(FreeInstance) X(SetupExperiment) X(EnterInitializationMode)                   \
    X(ExitInitializationMode) X(Terminate) X(Reset) X(GetReal) X(GetInteger) X(GetBoolean) X(GetString) X(SetReal)    \
    X(SetInteger) X(SetBoolean) X(SetString)
#define HC_FMI2_STATE(X)                                                                                              \
    X(GetFMUstate) X(SetFMUstate) X(FreeFMUstate) X(SerializedFMUstateSize) X(SerializeFMUstate) X(DeSerializeFMUstate)
#define HC_FMI2_EXCHANGE(X)                                                                                           \
    X(EnterEventMode) X(NewDiscreteStates) X(EnterContinuousTimeMode) X(CompletedIntegratorStep) X(SetTime)           \
    X(SetContinuousStates) X(GetDerivatives) X(GetEventIndicators) X(GetContinuousStates)                             \
    X(GetNominalsOfContinuousStates)
#define HC_FMI2_STEPS(X) X(DoStep) X(CancelStep)
#define HC_FMI2_PARTIALS(X) X(GetDirectionalDerivative)
#define HC_FMI2_ALL(X)                                                                                                \
    HC_FMI2_COMMON(X) HC_FMI2_STATE(X) HC_FMI2_EXCHANGE(X) HC_FMI2_STEPS(X) HC_FMI2_PARTIALS(X)

#define HC_MEMBER(function) __typeof__(FMI2(function)) *function;
struct hc_inner {
    void *library;
    fmi2Component component;
    HC_FMI2_ALL(HC_MEMBER)
};
#undef HC_MEMBER

/* Load the library and find its functions: NULL, or what is wrong, in `text`. */
const char *hc_inner_load_2(hc_inner *inner, const char *resources, const char *identifier, int kind, char *text,
                            size_t size);

#endif
