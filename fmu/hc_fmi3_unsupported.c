/* Functions of FMI 3.0 that these FMUs do not support: clocks, Scheduled Execution, dependencies of elements. */
#include "hc_fmi3_calls.h"

#define NO_CLOCKS(function)                                                                                           \
    ENTER(function, ANY);                                                                                             \
    (void)vr;                                                                                                         \
    (void)n;                                                                                                          \
    return (fmi3Status)hc_not_supported(c, "the FMU has no clocks")

fmi3Status FMI3(GetClock)(HC_REFERENCES, fmi3Clock values[])
{
    (void)values;
    NO_CLOCKS(GetClock);
}

fmi3Status FMI3(SetClock)(HC_REFERENCES, const fmi3Clock values[])
{
    (void)values;
    NO_CLOCKS(SetClock);
}

fmi3Status FMI3(GetIntervalDecimal)(HC_REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[])
{
    (void)intervals;
    (void)qualifiers;
    NO_CLOCKS(GetIntervalDecimal);
}

fmi3Status FMI3(GetIntervalFraction)(HC_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                     fmi3IntervalQualifier qualifiers[])
{
    (void)counters;
    (void)resolutions;
    (void)qualifiers;
    NO_CLOCKS(GetIntervalFraction);
}

fmi3Status FMI3(GetShiftDecimal)(HC_REFERENCES, fmi3Float64 shifts[])
{
    (void)shifts;
    NO_CLOCKS(GetShiftDecimal);
}

fmi3Status FMI3(GetShiftFraction)(HC_REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)counters;
    (void)resolutions;
    NO_CLOCKS(GetShiftFraction);
}

fmi3Status FMI3(SetIntervalDecimal)(HC_REFERENCES, const fmi3Float64 intervals[])
{
    (void)intervals;
    NO_CLOCKS(SetIntervalDecimal);
}

fmi3Status FMI3(SetIntervalFraction)(HC_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)counters;
    (void)resolutions;
    NO_CLOCKS(SetIntervalFraction);
}

fmi3Status FMI3(SetShiftDecimal)(HC_REFERENCES, const fmi3Float64 shifts[])
{
    (void)shifts;
    NO_CLOCKS(SetShiftDecimal);
}

fmi3Status FMI3(SetShiftFraction)(HC_REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])
{
    (void)counters;
    (void)resolutions;
    NO_CLOCKS(SetShiftFraction);
}

fmi3Status FMI3(ActivateModelPartition)(HC_ARGUMENTS, fmi3ValueReference clock, fmi3Float64 time)
{
    ENTER(ActivateModelPartition, ANY);
    (void)clock;
    (void)time;
    return (fmi3Status)hc_not_supported(c, "Scheduled Execution");
}

fmi3Status FMI3(GetNumberOfVariableDependencies)(HC_ARGUMENTS, fmi3ValueReference vr, size_t *n)
{
    ENTER(GetNumberOfVariableDependencies, ANY);
    (void)vr;
    (void)n;
    return (fmi3Status)hc_not_supported(c, "dependencies per element; see modelDescription.xml");
}

fmi3Status FMI3(GetVariableDependencies)(HC_ARGUMENTS, fmi3ValueReference dependent, size_t elements[],
                                         fmi3ValueReference independents[], size_t independent_elements[],
                                         fmi3DependencyKind kinds[], size_t n)
{
    ENTER(GetVariableDependencies, ANY);
    (void)dependent;
    (void)elements;
    (void)independents;
    (void)independent_elements;
    (void)kinds;
    (void)n;
    return (fmi3Status)hc_not_supported(c, "dependencies per element; see modelDescription.xml");
}
