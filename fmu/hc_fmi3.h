/* The functions of FMI 3.0 (fmi-standard.org, 3.0.2) that an FMU exports: types, then prototypes. The types are left
 * out if the standard's own header was included before. With FMI3_FUNCTION_PREFIX defined every function's name
 * begins with it.
 */
#ifndef HC_FMI3_H
#define HC_FMI3_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#ifndef fmi3FunctionTypes_h
typedef void *fmi3Instance, *fmi3InstanceEnvironment, *fmi3FMUState;
typedef uint32_t fmi3ValueReference;
typedef float fmi3Float32;
typedef double fmi3Float64;
typedef int8_t fmi3Int8;
typedef uint8_t fmi3UInt8, fmi3Byte;
typedef int16_t fmi3Int16;
typedef uint16_t fmi3UInt16;
typedef int32_t fmi3Int32;
typedef uint32_t fmi3UInt32;
typedef int64_t fmi3Int64;
typedef uint64_t fmi3UInt64;
typedef bool fmi3Boolean, fmi3Clock;
typedef const char *fmi3String;
typedef const uint8_t *fmi3Binary;

typedef enum { fmi3OK, fmi3Warning, fmi3Discard, fmi3Error, fmi3Fatal } fmi3Status;
typedef enum {
    fmi3Independent,
    fmi3Constant,
    fmi3Fixed,
    fmi3Tunable,
    fmi3Discrete,
    fmi3Dependent
} fmi3DependencyKind;
typedef enum { fmi3IntervalNotYetKnown, fmi3IntervalUnchanged, fmi3IntervalChanged } fmi3IntervalQualifier;

typedef void (*fmi3LogMessageCallback)(fmi3InstanceEnvironment, fmi3Status, fmi3String category, fmi3String message);
typedef void (*fmi3ClockUpdateCallback)(fmi3InstanceEnvironment);
typedef void (*fmi3IntermediateUpdateCallback)(fmi3InstanceEnvironment, fmi3Float64, fmi3Boolean, fmi3Boolean,
                                               fmi3Boolean, fmi3Boolean, fmi3Boolean *, fmi3Float64 *);
typedef void (*fmi3LockPreemptionCallback)(void);
typedef void (*fmi3UnlockPreemptionCallback)(void);
#endif

#define HC_PASTE_(a, b) a##b
#define HC_PASTE(a, b) HC_PASTE_(a, b)
#if defined FMI3_FUNCTION_PREFIX
#define FMI3(function) HC_PASTE(FMI3_FUNCTION_PREFIX, fmi3##function)
#define HC_EXPORT
#else
#define FMI3(function) fmi3##function
#if defined _WIN32 || defined __CYGWIN__
#define HC_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define HC_EXPORT __attribute__((visibility("default")))
#else
#define HC_EXPORT
#endif
#endif

#define HC_ARGUMENTS fmi3Instance instance
#define HC_REFERENCES fmi3Instance instance, const fmi3ValueReference vr[], size_t n

HC_EXPORT const char *FMI3(GetVersion)(void);
HC_EXPORT fmi3Status FMI3(SetDebugLogging)(HC_ARGUMENTS, fmi3Boolean on, size_t n, const fmi3String categories[]);

HC_EXPORT fmi3Instance FMI3(InstantiateModelExchange)(fmi3String name, fmi3String token, fmi3String resources,
                                                      fmi3Boolean visible, fmi3Boolean logging,
                                                      fmi3InstanceEnvironment environment, fmi3LogMessageCallback log);
HC_EXPORT fmi3Instance FMI3(InstantiateCoSimulation)(fmi3String name, fmi3String token, fmi3String resources,
                                                     fmi3Boolean visible, fmi3Boolean logging, fmi3Boolean event_mode,
                                                     fmi3Boolean early_return, const fmi3ValueReference intermediate[],
                                                     size_t n_intermediate, fmi3InstanceEnvironment environment,
                                                     fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update);
HC_EXPORT fmi3Instance FMI3(InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                           fmi3Boolean visible, fmi3Boolean logging,
                                                           fmi3InstanceEnvironment environment,
                                                           fmi3LogMessageCallback log, fmi3ClockUpdateCallback update,
                                                           fmi3LockPreemptionCallback lock,
                                                           fmi3UnlockPreemptionCallback unlock);
HC_EXPORT void FMI3(FreeInstance)(HC_ARGUMENTS);

HC_EXPORT fmi3Status FMI3(EnterInitializationMode)(HC_ARGUMENTS, fmi3Boolean has_tolerance, fmi3Float64 tolerance,
                                                   fmi3Float64 start, fmi3Boolean has_stop, fmi3Float64 stop);
HC_EXPORT fmi3Status FMI3(ExitInitializationMode)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(EnterEventMode)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(Terminate)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(Reset)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(EnterConfigurationMode)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(ExitConfigurationMode)(HC_ARGUMENTS);

/* X(name, type) for each type of variable but Binary and Clock */
#define HC_FMI3_TYPES(X)                                                                                              \
    X(Float32, fmi3Float32)                                                                                           \
    X(Float64, fmi3Float64)                                                                                           \
    X(Int8, fmi3Int8)                                                                                                 \
    X(UInt8, fmi3UInt8)                                                                                               \
    X(Int16, fmi3Int16)                                                                                               \
    X(UInt16, fmi3UInt16)                                                                                             \
    X(Int32, fmi3Int32)                                                                                               \
    X(UInt32, fmi3UInt32)                                                                                             \
    X(Int64, fmi3Int64)                                                                                               \
    X(UInt64, fmi3UInt64)                                                                                             \
    X(Boolean, fmi3Boolean)                                                                                           \
    X(String, fmi3String)
#define HC_GET_AND_SET(name, type)                                                                                    \
    HC_EXPORT fmi3Status FMI3(Get##name)(HC_REFERENCES, type values[], size_t n_values);                              \
    HC_EXPORT fmi3Status FMI3(Set##name)(HC_REFERENCES, const type values[], size_t n_values);
HC_FMI3_TYPES(HC_GET_AND_SET)
#undef HC_GET_AND_SET
HC_EXPORT fmi3Status FMI3(GetBinary)(HC_REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values);
HC_EXPORT fmi3Status FMI3(SetBinary)(HC_REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values);
HC_EXPORT fmi3Status FMI3(GetClock)(HC_REFERENCES, fmi3Clock values[]);
HC_EXPORT fmi3Status FMI3(SetClock)(HC_REFERENCES, const fmi3Clock values[]);

HC_EXPORT fmi3Status FMI3(GetNumberOfVariableDependencies)(HC_ARGUMENTS, fmi3ValueReference vr, size_t *n);
HC_EXPORT fmi3Status FMI3(GetVariableDependencies)(HC_ARGUMENTS, fmi3ValueReference dependent, size_t elements[],
                                                   fmi3ValueReference independents[], size_t independent_elements[],
                                                   fmi3DependencyKind kinds[], size_t n);

HC_EXPORT fmi3Status FMI3(GetFMUState)(HC_ARGUMENTS, fmi3FMUState *state);
HC_EXPORT fmi3Status FMI3(SetFMUState)(HC_ARGUMENTS, fmi3FMUState state);
HC_EXPORT fmi3Status FMI3(FreeFMUState)(HC_ARGUMENTS, fmi3FMUState *state);
HC_EXPORT fmi3Status FMI3(SerializedFMUStateSize)(HC_ARGUMENTS, fmi3FMUState state, size_t *size);
HC_EXPORT fmi3Status FMI3(SerializeFMUState)(HC_ARGUMENTS, fmi3FMUState state, fmi3Byte bytes[], size_t size);
HC_EXPORT fmi3Status FMI3(DeserializeFMUState)(HC_ARGUMENTS, const fmi3Byte bytes[], size_t size, fmi3FMUState *state);

#define HC_PARTIAL_ARGUMENTS                                                                                          \
    fmi3Instance instance, const fmi3ValueReference unknowns[], size_t n_unknowns, const fmi3ValueReference knowns[], \
        size_t n_knowns, const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[], size_t n_sensitivity
HC_EXPORT fmi3Status FMI3(GetDirectionalDerivative)(HC_PARTIAL_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(GetAdjointDerivative)(HC_PARTIAL_ARGUMENTS);

HC_EXPORT fmi3Status FMI3(GetIntervalDecimal)(HC_REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]);
HC_EXPORT fmi3Status FMI3(GetIntervalFraction)(HC_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                               fmi3IntervalQualifier qualifiers[]);
HC_EXPORT fmi3Status FMI3(GetShiftDecimal)(HC_REFERENCES, fmi3Float64 shifts[]);
HC_EXPORT fmi3Status FMI3(GetShiftFraction)(HC_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]);
HC_EXPORT fmi3Status FMI3(SetIntervalDecimal)(HC_REFERENCES, const fmi3Float64 intervals[]);
HC_EXPORT fmi3Status FMI3(SetIntervalFraction)(HC_REFERENCES, const fmi3UInt64 counters[],
                                               const fmi3UInt64 resolutions[]);
HC_EXPORT fmi3Status FMI3(SetShiftDecimal)(HC_REFERENCES, const fmi3Float64 shifts[]);
HC_EXPORT fmi3Status FMI3(SetShiftFraction)(HC_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]);
HC_EXPORT fmi3Status FMI3(EvaluateDiscreteStates)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(UpdateDiscreteStates)(HC_ARGUMENTS, fmi3Boolean *need_update, fmi3Boolean *terminate,
                                                fmi3Boolean *nominals_changed, fmi3Boolean *states_changed,
                                                fmi3Boolean *has_next, fmi3Float64 *next);

HC_EXPORT fmi3Status FMI3(EnterContinuousTimeMode)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(CompletedIntegratorStep)(HC_ARGUMENTS, fmi3Boolean no_return, fmi3Boolean *enter_event_mode,
                                                   fmi3Boolean *terminate);
HC_EXPORT fmi3Status FMI3(SetTime)(HC_ARGUMENTS, fmi3Float64 time);
HC_EXPORT fmi3Status FMI3(SetContinuousStates)(HC_ARGUMENTS, const fmi3Float64 states[], size_t n);
HC_EXPORT fmi3Status FMI3(GetContinuousStateDerivatives)(HC_ARGUMENTS, fmi3Float64 derivatives[], size_t n);
HC_EXPORT fmi3Status FMI3(GetEventIndicators)(HC_ARGUMENTS, fmi3Float64 indicators[], size_t n);
HC_EXPORT fmi3Status FMI3(GetContinuousStates)(HC_ARGUMENTS, fmi3Float64 states[], size_t n);
HC_EXPORT fmi3Status FMI3(GetNominalsOfContinuousStates)(HC_ARGUMENTS, fmi3Float64 nominals[], size_t n);
HC_EXPORT fmi3Status FMI3(GetNumberOfEventIndicators)(HC_ARGUMENTS, size_t *n);
HC_EXPORT fmi3Status FMI3(GetNumberOfContinuousStates)(HC_ARGUMENTS, size_t *n);

HC_EXPORT fmi3Status FMI3(EnterStepMode)(HC_ARGUMENTS);
HC_EXPORT fmi3Status FMI3(GetOutputDerivatives)(HC_REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[],
                                                size_t n_values);
HC_EXPORT fmi3Status FMI3(DoStep)(HC_ARGUMENTS, fmi3Float64 time, fmi3Float64 length, fmi3Boolean no_return,
                                  fmi3Boolean *event, fmi3Boolean *terminate, fmi3Boolean *early,
                                  fmi3Float64 *last_time);
HC_EXPORT fmi3Status FMI3(ActivateModelPartition)(HC_ARGUMENTS, fmi3ValueReference clock, fmi3Float64 time);

#endif
