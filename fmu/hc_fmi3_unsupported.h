/* Functions of FMI 3.0 that no FMU here supports: clocks, Scheduled Execution, dependencies of elements. Included once,
 * by hc_fmi3_values.c or hc_around_fmi3_values.c.
 */
#if defined __GNUC__
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif

#define REFUSE(function, what, ...)                                                                                   \
    fmi3Status FMI3(function)(__VA_ARGS__)                                                                            \
    {                                                                                                                 \
        ENTER(function, ANY);                                                                                         \
        return (fmi3Status)RUN(not_supported)(c, what);                                                               \
    }
#define NO_CLOCKS(function, ...) REFUSE(function, "the FMU has no clocks", HC_REFERENCES, __VA_ARGS__)
NO_CLOCKS(GetClock, fmi3Clock values[])
NO_CLOCKS(SetClock, const fmi3Clock values[])
NO_CLOCKS(GetIntervalDecimal, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(GetIntervalFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[])
NO_CLOCKS(GetShiftDecimal, fmi3Float64 shifts[])
NO_CLOCKS(GetShiftFraction, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
NO_CLOCKS(SetIntervalDecimal, const fmi3Float64 intervals[])
NO_CLOCKS(SetIntervalFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
NO_CLOCKS(SetShiftDecimal, const fmi3Float64 shifts[])
NO_CLOCKS(SetShiftFraction, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
REFUSE(ActivateModelPartition, "Scheduled Execution", HC_ARGUMENTS, fmi3ValueReference clock, fmi3Float64 time)
#define NO_ELEMENTS "dependencies per element; see modelDescription.xml"
REFUSE(GetNumberOfVariableDependencies, NO_ELEMENTS, HC_ARGUMENTS, fmi3ValueReference vr, size_t *n)
REFUSE(GetVariableDependencies, NO_ELEMENTS, HC_ARGUMENTS, fmi3ValueReference dependent, size_t places[],
       fmi3ValueReference independents[], size_t independent_places[], fmi3DependencyKind kinds[], size_t n)

fmi3Instance FMI3(InstantiateScheduledExecution)(fmi3String name, fmi3String token, fmi3String resources,
                                                 fmi3Boolean visible, fmi3Boolean logging,
                                                 fmi3InstanceEnvironment environment, fmi3LogMessageCallback callback,
                                                 fmi3ClockUpdateCallback update, fmi3LockPreemptionCallback lock,
                                                 fmi3UnlockPreemptionCallback unlock)
{
    if (callback)
        callback(environment, fmi3Error, "logStatusError",
                 "fmi3InstantiateScheduledExecution: not supported; the FMU has Model Exchange and Co-Simulation");
    return NULL;
}
