/* The functions of FMI 2.0 (fmi-standard.org, 2.0.5) that an FMU exports: types, then prototypes. The types are left
 * out if the standard's own header was included before. With FMI2_FUNCTION_PREFIX defined every function's name
 * begins with it.
 */
#ifndef HC_FMI2_H
#define HC_FMI2_H

#include <stddef.h>

#ifndef fmi2FunctionTypes_h
typedef void *fmi2Component, *fmi2ComponentEnvironment, *fmi2FMUstate;
typedef unsigned int fmi2ValueReference;
typedef double fmi2Real;
typedef int fmi2Integer, fmi2Boolean;
typedef const char *fmi2String;
typedef char fmi2Byte;

typedef enum { fmi2OK, fmi2Warning, fmi2Discard, fmi2Error, fmi2Fatal, fmi2Pending } fmi2Status;
typedef enum { fmi2ModelExchange, fmi2CoSimulation } fmi2Type;
typedef enum { fmi2DoStepStatus, fmi2PendingStatus, fmi2LastSuccessfulTime, fmi2Terminated } fmi2StatusKind;

typedef void (*fmi2CallbackLogger)(fmi2ComponentEnvironment, fmi2String instance, fmi2Status, fmi2String category,
                                   fmi2String message, ...);
typedef void *(*fmi2CallbackAllocateMemory)(size_t, size_t);
typedef void (*fmi2CallbackFreeMemory)(void *);
typedef void (*fmi2StepFinished)(fmi2ComponentEnvironment, fmi2Status);

typedef struct {
    fmi2CallbackLogger logger;
    fmi2CallbackAllocateMemory allocateMemory;
    fmi2CallbackFreeMemory freeMemory;
    fmi2StepFinished stepFinished;
    fmi2ComponentEnvironment componentEnvironment;
} fmi2CallbackFunctions;

typedef struct {
    fmi2Boolean newDiscreteStatesNeeded;
    fmi2Boolean terminateSimulation;
    fmi2Boolean nominalsOfContinuousStatesChanged;
    fmi2Boolean valuesOfContinuousStatesChanged;
    fmi2Boolean nextEventTimeDefined;
    fmi2Real nextEventTime;
} fmi2EventInfo;
#endif

#define HC_PASTE_(a, b) a##b
#define HC_PASTE(a, b) HC_PASTE_(a, b)
#if defined FMI2_FUNCTION_PREFIX
#define FMI2(function) HC_PASTE(FMI2_FUNCTION_PREFIX, fmi2##function)
#define HC_EXPORT
#else
#define FMI2(function) fmi2##function
#if defined _WIN32 || defined __CYGWIN__
#define HC_EXPORT __declspec(dllexport)
#elif defined __GNUC__
#define HC_EXPORT __attribute__((visibility("default")))
#else
#define HC_EXPORT
#endif
#endif

#define HC_ARGUMENTS fmi2Component instance
#define HC_REFERENCES fmi2Component instance, const fmi2ValueReference vr[], size_t n

HC_EXPORT const char *FMI2(GetTypesPlatform)(void);
HC_EXPORT const char *FMI2(GetVersion)(void);
HC_EXPORT fmi2Status FMI2(SetDebugLogging)(HC_ARGUMENTS, fmi2Boolean on, size_t n, const fmi2String categories[]);

HC_EXPORT fmi2Component FMI2(Instantiate)(fmi2String name, fmi2Type type, fmi2String guid, fmi2String resources,
                                          const fmi2CallbackFunctions *functions, fmi2Boolean visible,
                                          fmi2Boolean logging);
HC_EXPORT void FMI2(FreeInstance)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(SetupExperiment)(HC_ARGUMENTS, fmi2Boolean has_tolerance, fmi2Real tolerance,
                                           fmi2Real start, fmi2Boolean has_stop, fmi2Real stop);
HC_EXPORT fmi2Status FMI2(EnterInitializationMode)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(ExitInitializationMode)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(Terminate)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(Reset)(HC_ARGUMENTS);

HC_EXPORT fmi2Status FMI2(GetReal)(HC_REFERENCES, fmi2Real values[]);
HC_EXPORT fmi2Status FMI2(GetInteger)(HC_REFERENCES, fmi2Integer values[]);
HC_EXPORT fmi2Status FMI2(GetBoolean)(HC_REFERENCES, fmi2Boolean values[]);
HC_EXPORT fmi2Status FMI2(GetString)(HC_REFERENCES, fmi2String values[]);
HC_EXPORT fmi2Status FMI2(SetReal)(HC_REFERENCES, const fmi2Real values[]);
HC_EXPORT fmi2Status FMI2(SetInteger)(HC_REFERENCES, const fmi2Integer values[]);
HC_EXPORT fmi2Status FMI2(SetBoolean)(HC_REFERENCES, const fmi2Boolean values[]);
HC_EXPORT fmi2Status FMI2(SetString)(HC_REFERENCES, const fmi2String values[]);

HC_EXPORT fmi2Status FMI2(GetFMUstate)(HC_ARGUMENTS, fmi2FMUstate *state);
HC_EXPORT fmi2Status FMI2(SetFMUstate)(HC_ARGUMENTS, fmi2FMUstate state);
HC_EXPORT fmi2Status FMI2(FreeFMUstate)(HC_ARGUMENTS, fmi2FMUstate *state);
HC_EXPORT fmi2Status FMI2(SerializedFMUstateSize)(HC_ARGUMENTS, fmi2FMUstate state, size_t *size);
HC_EXPORT fmi2Status FMI2(SerializeFMUstate)(HC_ARGUMENTS, fmi2FMUstate state, fmi2Byte bytes[], size_t size);
HC_EXPORT fmi2Status FMI2(DeSerializeFMUstate)(HC_ARGUMENTS, const fmi2Byte bytes[], size_t size, fmi2FMUstate *state);

HC_EXPORT fmi2Status FMI2(GetDirectionalDerivative)(HC_ARGUMENTS, const fmi2ValueReference unknowns[],
                                                    size_t n_unknowns, const fmi2ValueReference knowns[],
                                                    size_t n_knowns, const fmi2Real seed[], fmi2Real sensitivity[]);

HC_EXPORT fmi2Status FMI2(EnterEventMode)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(NewDiscreteStates)(HC_ARGUMENTS, fmi2EventInfo *info);
HC_EXPORT fmi2Status FMI2(EnterContinuousTimeMode)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(CompletedIntegratorStep)(HC_ARGUMENTS, fmi2Boolean no_return, fmi2Boolean *enter_event_mode,
                                                   fmi2Boolean *terminate);
HC_EXPORT fmi2Status FMI2(SetTime)(HC_ARGUMENTS, fmi2Real time);
HC_EXPORT fmi2Status FMI2(SetContinuousStates)(HC_ARGUMENTS, const fmi2Real states[], size_t n);
HC_EXPORT fmi2Status FMI2(GetDerivatives)(HC_ARGUMENTS, fmi2Real derivatives[], size_t n);
HC_EXPORT fmi2Status FMI2(GetEventIndicators)(HC_ARGUMENTS, fmi2Real indicators[], size_t n);
HC_EXPORT fmi2Status FMI2(GetContinuousStates)(HC_ARGUMENTS, fmi2Real states[], size_t n);
HC_EXPORT fmi2Status FMI2(GetNominalsOfContinuousStates)(HC_ARGUMENTS, fmi2Real nominals[], size_t n);

HC_EXPORT fmi2Status FMI2(SetRealInputDerivatives)(HC_REFERENCES, const fmi2Integer orders[], const fmi2Real values[]);
HC_EXPORT fmi2Status FMI2(GetRealOutputDerivatives)(HC_REFERENCES, const fmi2Integer orders[], fmi2Real values[]);
HC_EXPORT fmi2Status FMI2(DoStep)(HC_ARGUMENTS, fmi2Real time, fmi2Real length, fmi2Boolean no_return);
HC_EXPORT fmi2Status FMI2(CancelStep)(HC_ARGUMENTS);
HC_EXPORT fmi2Status FMI2(GetStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Status *value);
HC_EXPORT fmi2Status FMI2(GetRealStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Real *value);
HC_EXPORT fmi2Status FMI2(GetIntegerStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Integer *value);
HC_EXPORT fmi2Status FMI2(GetBooleanStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2Boolean *value);
HC_EXPORT fmi2Status FMI2(GetStringStatus)(HC_ARGUMENTS, const fmi2StatusKind kind, fmi2String *value);

#endif
