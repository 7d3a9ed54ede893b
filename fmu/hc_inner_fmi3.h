/* Private to the runtime: the calls of FMI 3.0 to the FMU inside a corrected FMU. */
#ifndef HC_INNER_FMI3_H
#define HC_INNER_FMI3_H

#include "hc_fmi3.h"
#include "hc_inner.h"

/* X(function) for those that every FMU has, for those of Model Exchange and for those of Co-Simulation. */
#define HC_FMI3_COMMON(X)                                                                                             \
    X(SetDebugLogging) X(FreeInstance) X(EnterInitializationMode) X(ExitInitializationMode) X(Terminate) X(Reset)     \
    X(GetFloat32) X(SetFloat32) X(GetFloat64) X(SetFloat64) X(GetInt8) X(SetInt8) X(GetUInt8) X(SetUInt8)             \
    X(GetInt16) X(SetInt16) X(GetUInt16) X(SetUInt16) X(GetInt32) X(SetInt32) X(GetUInt32) X(SetUInt32) X(GetInt64)   \
    X(SetInt64) X(GetUInt64) X(SetUInt64) X(GetBoolean) X(SetBoolean) X(GetString) X(SetString) X(GetBinary)          \
    X(SetBinary)
#define HC_FMI3_STATE(X)                                                                                              \
    X(GetFMUState) X(SetFMUState) X(FreeFMUState) X(SerializedFMUStateSize) X(SerializeFMUState) X(DeserializeFMUState)
#define HC_FMI3_EXCHANGE(X)                                                                                           \
    X(InstantiateModelExchange) X(EnterEventMode) X(UpdateDiscreteStates) X(EnterContinuousTimeMode)                  \
    X(CompletedIntegratorStep) X(SetTime) X(SetContinuousStates) X(GetContinuousStates)                               \
    X(GetContinuousStateDerivatives) X(GetEventIndicators) X(GetNominalsOfContinuousStates)
#define HC_FMI3_STEPS(X) X(InstantiateCoSimulation) X(DoStep)
#define HC_FMI3_PARTIALS(X) X(GetDirectionalDerivative) X(GetAdjointDerivative)
#define HC_FMI3_ALL(X)                                                                                                \
    HC_FMI3_COMMON(X) HC_FMI3_STATE(X) HC_FMI3_EXCHANGE(X) HC_FMI3_STEPS(X) HC_FMI3_PARTIALS(X)

#define HC_MEMBER(function) __typeof__(FMI3(function)) *function;
struct hc_inner {
    void *library;
    fmi3Instance component;
    HC_FMI3_ALL(HC_MEMBER)
};
#undef HC_MEMBER

/* Load the library and find its functions: NULL, or what is wrong, in `text`. */
const char *hc_inner_load_3(hc_inner *inner, const char *resources, const char *identifier, int kind, char *text,
                            size_t size);

#endif
