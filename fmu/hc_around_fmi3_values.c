/* FMI 3.0 of a corrected FMU: values, and the functions that it does not support. */
#include "hc_inner_fmi3.h"

#include "hc_around.h"

#include "hc_calls.h"

/* ---- values ---- */

static int wrong_count(hc_around *c, const fmi3ValueReference vr[], size_t n, size_t n_values)
{
    if (n == 0 || !vr || hc_around_width(vr, n) == n_values)
        return HC_DONE;
    return hc_around_fail(c, "%zu values where the variables have %zu", n_values, hc_around_width(vr, n));
}

fmi3Status FMI3(GetFloat64)(HC_REFERENCES, fmi3Float64 values[], size_t n_values)
{
    ENTER(GetFloat64, ANY);
    return wrong_count(c, vr, n, n_values) ? fmi3Error : (fmi3Status)hc_around_get(c, vr, n, values);
}

fmi3Status FMI3(SetFloat64)(HC_REFERENCES, const fmi3Float64 values[], size_t n_values)
{
    ENTER(SetFloat64, SETTABLE);
    return wrong_count(c, vr, n, n_values) ? fmi3Error : (fmi3Status)hc_around_set(c, vr, n, values);
}

static int refreshed(hc_around *c)
{
    return !(c->state & (HC_INITIALIZATION | INITIALIZED)) || hc_around_evaluate(c) < HC_ERROR;
}

#define GET_AND_SET(name, type)                                                                                       \
    fmi3Status FMI3(Get##name)(HC_REFERENCES, type values[], size_t n_values)                                         \
    {                                                                                                                 \
        ENTER(Get##name, ANY);                                                                                        \
        return refreshed(c) ? PASS(Get##name, vr, n, values, n_values) : fmi3Error;                                   \
    }                                                                                                                 \
    fmi3Status FMI3(Set##name)(HC_REFERENCES, const type values[], size_t n_values)                                   \
    {                                                                                                                 \
        ENTER(Set##name, SETTABLE);                                                                                   \
        if (hc_around_before_set(c) >= HC_DISCARD)                                                                    \
            return fmi3Error;                                                                                         \
        return PASS(Set##name, vr, n, values, n_values);                                                              \
    }
GET_AND_SET(Float32, fmi3Float32)
GET_AND_SET(Int8, fmi3Int8)
GET_AND_SET(UInt8, fmi3UInt8)
GET_AND_SET(Int16, fmi3Int16)
GET_AND_SET(UInt16, fmi3UInt16)
GET_AND_SET(Int32, fmi3Int32)
GET_AND_SET(UInt32, fmi3UInt32)
GET_AND_SET(Int64, fmi3Int64)
GET_AND_SET(UInt64, fmi3UInt64)
GET_AND_SET(Boolean, fmi3Boolean)
GET_AND_SET(String, fmi3String)

fmi3Status FMI3(GetBinary)(HC_REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values)
{
    ENTER(GetBinary, ANY);
    return refreshed(c) ? PASS(GetBinary, vr, n, sizes, values, n_values) : fmi3Error;
}

fmi3Status FMI3(SetBinary)(HC_REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values)
{
    ENTER(SetBinary, SETTABLE);
    if (hc_around_before_set(c) >= HC_DISCARD)
        return fmi3Error;
    return PASS(SetBinary, vr, n, sizes, values, n_values);
}

/* ---- partial derivatives ---- */

fmi3Status FMI3(GetDirectionalDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetDirectionalDerivative, HC_INITIALIZATION | INITIALIZED);
    if (wrong_count(c, knowns, n_knowns, n_seed) || wrong_count(c, unknowns, n_unknowns, n_sensitivity))
        return fmi3Error;
    return (fmi3Status)hc_around_partials(c, 0, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

fmi3Status FMI3(GetAdjointDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetAdjointDerivative, HC_INITIALIZATION | INITIALIZED);
    if (wrong_count(c, unknowns, n_unknowns, n_seed) || wrong_count(c, knowns, n_knowns, n_sensitivity))
        return fmi3Error;
    return (fmi3Status)hc_around_partials(c, 1, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

/* ---- not supported ---- */

#include "hc_fmi3_unsupported.h"

REFUSE(GetOutputDerivatives, "derivatives of outputs", HC_REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[],
       size_t n_values)
REFUSE(EnterConfigurationMode, "structural parameters", HC_ARGUMENTS)
REFUSE(ExitConfigurationMode, "structural parameters", HC_ARGUMENTS)
REFUSE(EnterStepMode, "Event Mode in Co-Simulation", HC_ARGUMENTS)
