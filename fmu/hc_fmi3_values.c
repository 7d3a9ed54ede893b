/* FMI 3.0 in terms of hc_instance.h: values, partial derivatives; what is not supported. */
#include "hc_fmi3.h"

#include "hc_calls.h"

#include <stdlib.h>

/* ---- values ---- */

/* The array that a value reference belongs to; the number of arrays if it belongs to none. */
static size_t array_of(unsigned vr)
{
    size_t low = 0, high = hc_description.n_arrays;
    while (low < high) { /* the first array that ends after vr */
        const size_t middle = (low + high) / 2;
        if (vr < hc_description.array_first[middle] + hc_description.array_size[middle])
            high = middle;
        else
            low = middle + 1;
    }
    return low < hc_description.n_arrays && vr >= hc_description.array_first[low] ? low : hc_description.n_arrays;
}

/* A list of value references with the elements of arrays, at `at` of the instance's work space; `list` is the same if
 * there are no arrays. 0, with a message, if the list is wrong. */
typedef struct {
    const unsigned *vr;
    size_t n, at;
    int copied;
} elements;

static int expand(hc_instance *c, const unsigned *vr, size_t n, size_t at, elements *list)
{
    const size_t none = hc_description.n_arrays;
    size_t total = 0;
    list->vr = vr;
    list->n = n;
    list->at = at;
    list->copied = 0;
    if (none == 0 || n == 0)
        return 1;
    if (hc_no_null(c, vr, "valueReferences", n))
        return 0;
    for (size_t i = 0; i < n; i++) {
        const size_t k = array_of(vr[i]);
        if (k < none && vr[i] != hc_description.array_first[k]) {
            hc_fail(c, "unknown value reference %u: it lies in the array with value reference %u", vr[i],
                    hc_description.array_first[k]);
            return 0;
        }
        total += k < none ? hc_description.array_size[k] : 1;
    }
    if (total == n)
        return 1;
    if (at + total > c->n_expanded) {
        unsigned *more = realloc(c->expanded, 2 * (at + total) * sizeof *more);
        if (!more) {
            hc_fail(c, "no memory");
            return 0;
        }
        c->expanded = more;
        c->n_expanded = 2 * (at + total);
    }
    list->n = total;
    list->copied = 1;
    for (size_t i = 0; i < n; i++) {
        const size_t k = array_of(vr[i]), size = k < none ? hc_description.array_size[k] : 1;
        for (size_t j = 0; j < size; j++)
            c->expanded[at++] = vr[i] + (unsigned)j;
    }
    return 1;
}

static const unsigned *references(const hc_instance *c, const elements *list)
{
    return list->copied ? c->expanded + list->at : list->vr;
}

static int wrong_count(hc_instance *c, size_t n, size_t n_elements, size_t n_values)
{
    if (n_elements == n_values)
        return HC_DONE;
    if (n == n_elements)
        return hc_fail(c, "%zu value references but %zu values", n, n_values);
    return hc_fail(c, "%zu value references, arrays among them, have %zu elements, but there are %zu values", n,
                   n_elements, n_values);
}

/* Every call that takes values: `list` has the elements, `n_values` fits. */
#define EXPANDED                                                                                                      \
    elements list;                                                                                                    \
    if (!expand(c, vr, n, 0, &list) || wrong_count(c, n, list.n, n_values))                                           \
    return fmi3Error

fmi3Status FMI3(GetFloat64)(HC_REFERENCES, fmi3Float64 values[], size_t n_values)
{
    ENTER(GetFloat64, ANY | HC_INTERMEDIATE);
    EXPANDED;
    return (fmi3Status)hc_get_reals(c, references(c, &list), list.n, values);
}

fmi3Status FMI3(SetFloat64)(HC_REFERENCES, const fmi3Float64 values[], size_t n_values)
{
    ENTER(SetFloat64, SETTABLE);
    EXPANDED;
    return (fmi3Status)hc_set_reals(c, references(c, &list), list.n, values);
}

fmi3Status FMI3(GetInt32)(HC_REFERENCES, fmi3Int32 values[], size_t n_values)
{
    ENTER(GetInt32, ANY | HC_INTERMEDIATE);
    return wrong_count(c, n, n, n_values) ? fmi3Error : (fmi3Status)hc_get_modes(c, vr, n, values);
}

/* Types without variables, and Int32, whose variables cannot be set. */
#define NO_GET(name, type)                                                                                            \
    fmi3Status FMI3(Get##name)(HC_REFERENCES, type values[], size_t n_values)                                         \
    {                                                                                                                 \
        ENTER(Get##name, ANY | HC_INTERMEDIATE);                                                                                        \
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
    ENTER(GetBinary, ANY | HC_INTERMEDIATE);
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

/* ---- partial derivatives ---- */

static fmi3Status partial_derivatives(hc_instance *c, int adjoint, const fmi3ValueReference unknowns[],
                                      size_t n_unknowns, const fmi3ValueReference knowns[], size_t n_knowns,
                                      const fmi3Float64 seed[], size_t n_seed, fmi3Float64 sensitivity[],
                                      size_t n_sensitivity)
{
    elements of, by;
    size_t expected_seed, expected;
    if (!expand(c, unknowns, n_unknowns, 0, &of) || !expand(c, knowns, n_knowns, of.copied ? of.n : 0, &by))
        return fmi3Error;
    expected_seed = adjoint ? of.n : by.n;
    expected = adjoint ? by.n : of.n;
    if (n_seed != expected_seed || n_sensitivity != expected)
        return (fmi3Status)hc_fail(c, "%zu seeds and %zu sensitivities where there must be %zu and %zu", n_seed,
                                   n_sensitivity, expected_seed, expected);
    return (fmi3Status)hc_partial_derivatives(c, adjoint, references(c, &of), of.n, references(c, &by), by.n, seed,
                                              sensitivity);
}

fmi3Status FMI3(GetDirectionalDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetDirectionalDerivative, COMPUTED | HC_INTERMEDIATE);
    return partial_derivatives(c, 0, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status FMI3(GetAdjointDerivative)(HC_PARTIAL_ARGUMENTS)
{
    ENTER(GetAdjointDerivative, COMPUTED | HC_INTERMEDIATE);
    return partial_derivatives(c, 1, unknowns, n_unknowns, knowns, n_knowns, seed, n_seed, sensitivity, n_sensitivity);
}

fmi3Status FMI3(GetOutputDerivatives)(HC_REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t n_values)
{
    int *expanded, status;
    ENTER(GetOutputDerivatives, HC_STEP | HC_INTERMEDIATE | ENDED);
    EXPANDED;
    if (!list.copied)
        return (fmi3Status)hc_output_derivatives(c, vr, orders, n, values);
    if (hc_no_null(c, orders, "orders", n))
        return fmi3Error;
    expanded = malloc(list.n * sizeof *expanded);
    if (!expanded)
        return (fmi3Status)hc_fail(c, "no memory");
    for (size_t i = 0, at = 0; i < n; i++) {
        const size_t k = array_of(vr[i]);
        for (size_t size = k < hc_description.n_arrays ? hc_description.array_size[k] : 1; size > 0; size--)
            expanded[at++] = orders[i];
    }
    status = hc_output_derivatives(c, references(c, &list), expanded, list.n, values);
    free(expanded);
    return (fmi3Status)status;
}

#include "hc_fmi3_unsupported.h"
