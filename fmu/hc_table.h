/* Private to the runtime: the functions that FMI 2.0 and FMI 3.0 define alike, for an FMU and for a corrected one. A row:
 *     X(how it begins, name in FMI 2 and in FMI 3, states in which FMI 2 and FMI 3 allow it, arguments, what it does)
 */
#ifndef HC_TABLE_H
#define HC_TABLE_H

#include "hc_calls.h"

#define HC_TABLE(X)                                                                                                   \
    X(ENTER, SetDebugLogging, SetDebugLogging, ANY, ANY,                                                              \
      (HC_ARGUMENTS, hc_boolean on, size_t n, const char *const categories[]), RUN(set_logging)(c, on, n, categories)) \
    X(ENTER, ExitInitializationMode, ExitInitializationMode, HC_INITIALIZATION, HC_INITIALIZATION, (HC_ARGUMENTS),    \
      RUN(exit_initialization)(c))                                                                                    \
    X(ENTER, Terminate, Terminate, INITIALIZED, INITIALIZED, (HC_ARGUMENTS), RUN(terminate)(c))                       \
    X(ENTER, Reset, Reset, ANY, ANY, (HC_ARGUMENTS), RUN(reset)(c))                                                   \
    X(ENTER, GetFMUstate, GetFMUState, ANY, ANY, (HC_ARGUMENTS, void **state), RUN(state_get)(c, state))              \
    X(ENTER, SetFMUstate, SetFMUState, ANY, ANY, (HC_ARGUMENTS, void *state), RUN(state_set)(c, state))               \
    X(ENTER, FreeFMUstate, FreeFMUState, ANY, ANY, (HC_ARGUMENTS, void **state), RUN(state_free)(c, state))           \
    X(ENTER, SerializedFMUstateSize, SerializedFMUStateSize, ANY, ANY, (HC_ARGUMENTS, void *state, size_t *size),     \
      RUN(state_size)(c, state, size))                                                                                \
    X(ENTER, SerializeFMUstate, SerializeFMUState, ANY, ANY, (HC_ARGUMENTS, void *state, hc_byte bytes[], size_t size), \
      RUN(state_write)(c, state, (unsigned char *)bytes, size))                                                       \
    X(ENTER, DeSerializeFMUstate, DeserializeFMUState, ANY, ANY,                                                      \
      (HC_ARGUMENTS, const hc_byte bytes[], size_t size, void **state),                                               \
      RUN(state_read)(c, (const unsigned char *)bytes, size, state))                                                  \
    X(ENTER_ME, EnterContinuousTimeMode, EnterContinuousTimeMode, HC_EVENT, HC_EVENT, (HC_ARGUMENTS),                 \
      RUN(enter_continuous)(c))                                                                                       \
    X(ENTER_ME, SetTime, SetTime, HC_EVENT | HC_CONTINUOUS_TIME, HC_CONTINUOUS_TIME, (HC_ARGUMENTS, double time),     \
      RUN(set_time)(c, time))                                                                                         \
    X(ENTER_ME, SetContinuousStates, SetContinuousStates, HC_CONTINUOUS_TIME, HC_CONTINUOUS_TIME,                     \
      (HC_ARGUMENTS, const double states[], size_t n), RUN(set_states)(c, states, n))                                 \
    X(ENTER_ME, GetContinuousStates, GetContinuousStates, READABLE, READABLE,                                         \
      (HC_ARGUMENTS, double states[], size_t n), RUN(get_part)(c, HC_STATES, states, n))                              \
    X(ENTER_ME, GetDerivatives, GetContinuousStateDerivatives, READABLE, READABLE,                                    \
      (HC_ARGUMENTS, double derivatives[], size_t n), RUN(get_part)(c, HC_DERIVATIVES, derivatives, n))               \
    X(ENTER_ME, GetEventIndicators, GetEventIndicators, READABLE, READABLE,                                           \
      (HC_ARGUMENTS, double indicators[], size_t n), RUN(get_part)(c, HC_INDICATORS, indicators, n))                  \
    X(ENTER_ME, GetNominalsOfContinuousStates, GetNominalsOfContinuousStates, ANY, COMPUTED,                          \
      (HC_ARGUMENTS, double nominals[], size_t n), RUN(get_nominals)(c, nominals, n))

#if defined HC_FMI2_H
#define HC_FUNCTION(enter, two, three, allowed2, allowed3, arguments, job)                                            \
    hc_status FMI2(two) arguments                                                                                     \
    {                                                                                                                 \
        enter(two, allowed2);                                                                                         \
        return (hc_status)(job);                                                                                      \
    }
#else
#define HC_FUNCTION(enter, two, three, allowed2, allowed3, arguments, job)                                            \
    hc_status FMI3(three) arguments                                                                                   \
    {                                                                                                                 \
        enter(three, allowed3);                                                                                       \
        return (hc_status)(job);                                                                                      \
    }
#endif

#endif
