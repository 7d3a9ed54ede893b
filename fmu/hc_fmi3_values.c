/* FMI 3.0 in terms of hc_instance.h: values, saved state, partial derivatives. */
#include "hc_fmi3_calls.h"

/* ---- values ---- */

static int wrong_count(hc_instance *c, size_t n, size_t n_values)
{
    if (n == n_values)
        return HC_DONE;
    return hc_fail(c, "%zu value references but %zu values; all variables are scalars", n, n_values);
}

fmi3Status FMI3(GetFloat64)(HC_REFERENCES, fmi3Float64 values[], size_t n_values)
{
    ENTER(GetFloat64, ANY);
    return wrong_count(c, n, n_values) ? fmi3Error : (fmi3Status)hc_get_reals(c, vr, n, values);
}

fmi3Status FMI3(SetFloat64)(HC_REFERENCES, const fmi3Float64 values[], size_t n_values)
{
    ENTER(SetFloat64, SETTABLE);
    return wrong_count(c, n, n_values) ? fmi3Error : (fmi3Status)hc_set_reals(c, vr, n, values);
}

fmi3Status FMI3(GetInt32)(HC_REFERENCES, fmi3Int32 values[], size_t n_values)
{
    ENTER(GetInt32, ANY);
    return wrong_count(c, n, n_values) ? fmi3Error : (fmi3Status)hc_get_modes(c, vr, n, values);
}

/* Types without variables, and Int32, whose variables cannot be set. */
#define NO_GET(name, type)                                                                                            \
    fmi3Status FMI3(Get##name)(HC_REFERENCES, type values[], size_t n_values)                                         \
    {                                                                                                                 \
        ENTER(Get##name, ANY);                                                                                        \
        (void)values;                                                                                                 \
        (void)n_values;                                                                                               \
        return (fmi3Status)hc_no_variable(c, #name, vr, n);                                                           \
    }
#define NO_SET(name, type)                                                                                            \
    fmi3Status FMI3(Set##name)(HC_REFERENCES, const type values[], size_t n_values)                                   \
    {                                                                                                                 \
        ENTER(Set##name, DISCRETE);                                                                                   \
        (void)values;                                                                                                 \
        (void)n_values;                                                                                               \
        return (fmi3Status)hc_no_variable(c, #name, vr, n);                                                           \
    }
#define NEITHER(name, type) NO_GET(name, type) NO_SET(name, type)
NEITHER(Float32, fmi3Float32)
NEITHER(Int8, fmi3Int8)
NEITHER(UInt8, fmi3UInt8)
NEITHER(Int16, fmi3Int16)
NEITHER(UInt16, fmi3UInt16)
NO_SET(Int32, fmi3Int32)
NEITHER(UInt32, fmi3UInt32)
NEITHER(Int64, fmi3Int64)
NEITHER(UInt64, fmi3UInt64)
NEITHER(Boolean, fmi3Boolean)
NEITHER(String, fmi3String)

fmi3Status FMI3(GetBinary)(HC_REFERENCES, size_t sizes[], fmi3Binary values[], size_t n_values)
{
    ENTER(GetBinary, ANY);
    (void)sizes;
    (void)values;
    (void)n_values;
    return (fmi3Status)hc_no_variable(c, "Binary", vr, n);
}

fmi3Status FMI3(SetBinary)(HC_REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t n_values)
{
    ENTER(SetBinary, DISCRETE);
    (void)sizes;
    (void)values;
    (void)n_values;
    return (fmi3Status)hc_no_variable(c, "Binary", vr, n);
}

/* ---- saved state ---- */

fmi3Status FMI3(GetFMUState)(HC_ARGUMENTS, fmi3FMUState *state)
{
    ENTER(GetFMUState, ANY);
    return (fmi3Status)hc_state_get(c, state);
}

fmi3Status FMI3(SetFMUState)(HC_ARGUMENTS, fmi3FMUState state)
{
    ENTER(SetFMUState, ANY);
    return (fmi3Status)hc_state_set(c, state);
}

fmi3Status FMI3(FreeFMUState)(HC_ARGUMENTS, fmi3FMUState *state)
{
    ENTER(FreeFMUState, ANY);
    return (fmi3Status)hc_state_free(c, state);
}

fmi3Status FMI3(SerializedFMUStateSize)(HC_ARGUMENTS, fmi3FMUState state, size_t *size)
{
    ENTER(SerializedFMUStateSize, ANY);
    return (fmi3Status)hc_state_size(c, state, size);
}

fmi3Status FMI3(SerializeFMUState)(HC_ARGUMENTS, fmi3FMUState state, fmi3Byte bytes[], size_t size)
{
    ENTER(SerializeFMUState, ANY);
    return (fmi3Status)hc_state_write(c, state, bytes, size);
}

fmi3Status FMI3(DeserializeFMUState)(HC_ARGUMENTS, const fmi3Byte bytes[], size_t size, fmi3FMUState *state)
{
    ENTER(DeserializeFMUState, ANY);
    return (fmi3Status)hc_state_read(c, bytes, size, state);
}

/* ---- partial derivatives ---- */

static fmi3Status partial_derivatives(hc_instance *c, int adjoint, const fmi3ValueReference unknowns[],
                                      size_t n_unknowns, const fmi3ValueReference knowns[], size_t n_knowns,
                                      const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
                                      size_t n_sensitivity)
{
    const size_t expected_seed = adjoint ? n_unknowns : n_knowns, expected = adjoint ? n_knowns : n_unknowns;
    if (n_seed != expected_seed || n_sensitivity != expected)
        return (fmi3Status)hc_fail(c, "%zu seeds and %zu sensitivities where there must be %zu and %zu", n_seed,
                                   n_sensitivity, expected_seed, expected);
    return (fmi3Status)hc_partial_derivatives(c, adjoint, unknowns, n_unknowns, knowns, n_knowns, seed, sensitivity);
}

fmi3Status FMI3(GetDirectionalDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetDirectionalDerivative, COMPUTED);
    return partial_derivatives(c, 0, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status FMI3(GetAdjointDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetAdjointDerivative, COMPUTED);
    return partial_derivatives(c, 1, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status FMI3(GetOutputDerivatives)(HC_REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
{
    ENTER(GetOutputDerivatives, HC_STEP | ENDED);
    if (wrong_count(c, n, n_values))
        return fmi3Error;
    return (fmi3Status)hc_output_derivatives(c, vr, orders, n, values);
}
