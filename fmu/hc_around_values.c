/* The real variables of a corrected FMU: which are the Block's, which the inner FMU's; they are read and set. */
#include "hc_around.h"

static const hc_around_table *const table = &hc_surroundings;

int hc_around_find(const unsigned *list, int n, unsigned vr)
{
    for (int i = 0; i < n; i++)
        if (list[i] == vr)
            return i;
    return -1;
}

int hc_around_kind(unsigned vr, int *place)
{
    const unsigned n = (unsigned)hc_model.n_states, moving = (unsigned)hc_around_continuous();
    if ((*place = hc_around_find(table->driven, table->n_driven, vr)) >= 0)
        return GIVEN;
    if ((*place = hc_around_find(table->measured, table->n_measured, vr)) >= 0)
        return MEASURED;
    if ((*place = hc_around_find(table->added, table->n_added, vr)) >= 0)
        return ADDED;
    if (vr < table->first || vr >= table->first + n + moving + (unsigned)hc_model.n_parameters)
        return INNER;
    vr -= table->first;
    *place = (int)(vr < n ? vr : vr < n + moving ? vr - n : vr - n - moving);
    return vr < n ? OWN_STATE : vr < n + moving ? OWN_SLOPE : OWN_PARAMETER;
}

static size_t size_of(unsigned vr)
{
    const int i = hc_around_find(table->array, table->n_arrays, vr);
    return i < 0 ? 1 : table->array_size[i];
}

size_t hc_around_width(const unsigned *vr, size_t n)
{
    size_t width = n;
    for (size_t i = 0; table->n_arrays > 0 && i < n; i++)
        width += size_of(vr[i]) - 1;
    return width;
}

static double own_value(hc_around *c, int kind, int i)
{
    switch (kind) {
    case GIVEN:
        return c->u[i];
    case MEASURED:
        return c->y[table->n_driven + i];
    case OWN_STATE:
        return c->x[i];
    case OWN_SLOPE:
        hc_model.derivatives(hc_around_time(c), c->x, c->in, c->p, NULL, c->dx);
        return c->dx[i];
    default:
        return c->p[i];
    }
}

int hc_around_get(hc_around *c, const unsigned *vr, size_t n, double *value)
{
    int i, status = HC_DONE, worst;
    if (n > 0 && (!vr || !value))
        return hc_around_fail(c, "valueReferences or values is NULL");
    if (c->state & (HC_INITIALIZATION | INITIALIZED)) /* otherwise the values of the last time stay */
        worst = hc_around_evaluate(c);
    else
        worst = HC_DONE;
    for (size_t k = 0; k < n && worst < HC_ERROR;) {
        size_t end = k;
        const int kind = hc_around_kind(vr[k], &i);
        if (kind != INNER && kind != ADDED) {
            *value++ = own_value(c, kind, i);
            k++;
            continue;
        }
        while (end < n && (end == k || (kind == INNER && hc_around_kind(vr[end], &i) == INNER)))
            end++;
        status = hc_inner_get_values(c->inner, vr + k, end - k, value, hc_around_width(vr + k, end - k));
        if (kind == ADDED) {
            hc_around_kind(vr[k], &i);
            value[0] += c->y[table->n_driven + table->n_measured + i];
        }
        value += hc_around_width(vr + k, end - k);
        k = end;
        worst = status > worst ? status : worst;
    }
    return hc_around_passed(c, worst);
}

static int set_own(hc_around *c, int kind, int i, double value)
{
    double *here = kind == GIVEN ? c->u + i : kind == OWN_STATE ? c->x + i : c->p + i;
    const int starting = (c->state & (HC_INSTANTIATED | HC_INITIALIZATION)) != 0;
    if (!hc_is_finite(value))
        return hc_around_fail(c, "a value is set to %s", value != value ? "NaN" : "an infinite value");
    if (kind == OWN_PARAMETER && !(value >= table->lower[i] && value <= table->upper[i]))
        return hc_around_fail(c, "parameter %s is set to %.17g, outside its bounds [%.17g, %.17g]", table->names[i],
                              value, table->lower[i], table->upper[i]);
    if (kind == OWN_PARAMETER && table->fixed[i] && !starting && value != *here)
        return hc_around_fail(c, "parameter %s is fixed at initialization", table->names[i]);
    if (kind == OWN_STATE && !starting && c->state != HC_CONTINUOUS_TIME)
        return hc_around_fail(c, "a state cannot be set now");
    if (*here != value) {
        *here = value;
        c->changed = 1;
    }
    return HC_DONE;
}

int hc_around_before_set(hc_around *c)
{
    int status = HC_DONE;
    if (c->state == HC_STEP && c->inner_kind == HC_MODEL_EXCHANGE && !c->inner_event) {
        status = hc_inner_enter_event(c->inner);
        c->inner_event = status < HC_DISCARD;
    }
    c->valid = 0;
    c->changed = 1;
    return hc_around_passed(c, status);
}

int hc_around_set(hc_around *c, const unsigned *vr, size_t n, const double *value)
{
    int i, status = HC_DONE;
    if (n > 0 && (!vr || !value))
        return hc_around_fail(c, "valueReferences or values is NULL");
    c->valid = 0;
    for (size_t k = 0; k < n && status < HC_DISCARD;) {
        size_t end = k;
        const int kind = hc_around_kind(vr[k], &i);
        if (kind == MEASURED || kind == OWN_SLOPE)
            return hc_around_fail(c, "value reference %u cannot be set", vr[k]);
        if (kind != INNER && kind != ADDED) {
            status = set_own(c, kind, i, *value++);
            k++;
            continue;
        }
        while (end < n && (end == k || hc_around_kind(vr[end], &i) == INNER))
            end++;
        status = hc_around_before_set(c);
        if (status < HC_DISCARD)
            status = hc_inner_set_values(c->inner, vr + k, end - k, value, hc_around_width(vr + k, end - k));
        value += hc_around_width(vr + k, end - k);
        k = end;
    }
#if HC_DELAYS
    if (status < HC_DISCARD && c->state == HC_CONTINUOUS_TIME)
        hc_delays_send_prompt(c->delays, c->u);
    else if (status < HC_DISCARD && c->state & (HC_EVENT | HC_STEP) && !hc_delays_send(c->delays, c->t, c->u))
        return hc_around_fail(c, "no memory");
#endif
    return hc_around_passed(c, status);
}
