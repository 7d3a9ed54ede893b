/* Products with the partial derivatives of a model. */
#include "hc_instance_internal.h"

#include <float.h>
#include <string.h>

/* Column of a known, row of an unknown; a state among the unknowns is the output equal to it. */
static int column_of(const hc_instance *c, unsigned vr)
{
    const int kind = hc_kind_of(c, vr);
    return kind == STATE || kind == INPUT || kind == PARAMETER ? (int)hc_place_of(c, kind, vr) : -1;
}

static int row_of(const hc_instance *c, unsigned vr)
{
    const int kind = hc_kind_of(c, vr), n = c->model->n_states;
    return kind == DERIVATIVE ? (int)(vr - c->first[DERIVATIVE])
           : kind == OUTPUT   ? n + (int)(vr - c->first[OUTPUT])
                              : -1;
}

static int check_partials(hc_instance *c, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                          size_t n_known)
{
    for (size_t i = 0; i < n_unknown; i++)
        if (hc_kind_of(c, unknown[i]) != STATE && row_of(c, unknown[i]) < 0)
            return hc_fail_at(c, unknown[i], "is no unknown: derivatives and outputs are");
    for (size_t i = 0; i < n_known; i++)
        if (column_of(c, known[i]) < 0)
            return hc_fail_at(c, known[i], "is no known: states, inputs and parameters are");
    return HC_DONE;
}

int hc_partial_derivatives(hc_instance *c, int adjoint, const unsigned *unknown, size_t n_unknown,
                           const unsigned *known, size_t n_known, const double *seed, double *sensitivity)
{
    const hc_model_type *m = c->model;
    const int columns = m->n_states + m->n_inputs + m->n_parameters, rows = m->n_states + m->n_outputs;
    const size_t n_seed = adjoint ? n_unknown : n_known, n_sensitivity = adjoint ? n_known : n_unknown;
    if (m->n_ticks > 0 && hc_n_continuous(c) == 0)
        return hc_not_supported(c, "partial derivatives of a model that only ticks");
    if (hc_no_null(c, unknown, "unknowns", n_unknown) || hc_no_null(c, known, "knowns", n_known) ||
        hc_no_null(c, seed, "seed", n_seed) || hc_no_null(c, sensitivity, "sensitivity", n_sensitivity) ||
        check_partials(c, unknown, n_unknown, known, n_known))
        return HC_ERROR;
    hc_read_states(c);
    if (!(c->valid & VALID_PARTIALS) && m->n_partials > 0)
        m->partials(hc_instance_time(c), c->x, c->in, c->p, c->mode, c->partial);
    c->valid |= VALID_PARTIALS;
    memset(c->seed, 0, (size_t)columns * sizeof *c->seed);
    memset(c->product, 0, (size_t)rows * sizeof *c->product);
    if (adjoint) {
        for (size_t i = 0; i < n_unknown; i++)
            if (hc_kind_of(c, unknown[i]) == STATE)
                c->seed[column_of(c, unknown[i])] += seed[i];
            else
                c->product[row_of(c, unknown[i])] += seed[i];
        for (int i = 0; i < m->n_partials; i++)
            c->seed[m->partial_column[i]] += c->partial[i] * c->product[m->partial_row[i]];
#if HC_DELAYS
        hc_delays_mask(c->delays, c->seed + m->n_states);
#endif
        for (size_t i = 0; i < n_known; i++)
            sensitivity[i] = c->seed[column_of(c, known[i])];
    } else {
        for (size_t i = 0; i < n_known; i++)
            c->seed[column_of(c, known[i])] += seed[i];
#if HC_DELAYS
        hc_delays_mask(c->delays, c->seed + m->n_states); /* a delayed input has no effect now */
#endif
        for (int i = 0; i < m->n_partials; i++)
            c->product[m->partial_row[i]] += c->partial[i] * c->seed[m->partial_column[i]];
        for (size_t i = 0; i < n_unknown; i++)
            sensitivity[i] = hc_kind_of(c, unknown[i]) == STATE ? c->seed[column_of(c, unknown[i])]
                                                             : c->product[row_of(c, unknown[i])];
    }
    for (size_t i = 0; i < n_sensitivity; i++)
        if (!hc_is_finite(sensitivity[i]))
            return hc_discard(c, "a partial derivative is not finite at time %.17g", c->value[0]);
    return HC_DONE;
}

/* y' = J x' + dy/dt, where inputs hold: J are the partial derivatives by the states; dy/dt, of what depends on time
 * itself, is a central difference. */
int hc_output_derivatives(hc_instance *c, const unsigned *vr, const int *order, size_t n, double *value)
{
    const hc_model_type *m = c->model;
    const int moving = (int)hc_n_continuous(c);
    const double t = hc_instance_time(c), h = cbrt(DBL_EPSILON) * fmax(1.0, fabs(t));
    /* on this side of a switch by the clock */
    const double from = c->solver ? fmax(t - h, c->solver->earliest) : t - h;
    const double to = c->solver ? fmin(t + h, c->solver->latest) : t + h;
    double *const moved = c->product;
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, order, "orders", n) ||
        hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t k = 0; k < n; k++) {
        const int kind = hc_kind_of(c, vr[k]);
        if (order[k] != 1)
            return hc_fail(c, "a derivative of order %d; there are those of order 1", order[k]);
        if (kind != STATE && kind != OUTPUT)
            return hc_fail_at(c, vr[k], "is not an output");
    }
    hc_evaluate(c, DERIVATIVE);
    if (!(c->valid & VALID_PARTIALS) && m->n_partials > 0)
        m->partials(t, c->x, c->in, c->p, c->mode, c->partial);
    c->valid |= VALID_PARTIALS;
    for (size_t k = 0; k < n; k++) {
        const unsigned place = vr[k] - c->first[hc_kind_of(c, vr[k])];
        if (hc_kind_of(c, vr[k]) == STATE) {
            value[k] = (int)place < moving ? c->dx[place] : 0.0;
            continue;
        }
        m->outputs(to, c->x, c->in, c->p, c->mode, moved);
        value[k] = moved[place];
        m->outputs(from, c->x, c->in, c->p, c->mode, moved);
        value[k] = to > from ? (value[k] - moved[place]) / (to - from) : 0.0;
        for (int i = 0; i < m->n_partials; i++)
            if (m->partial_row[i] == (unsigned)m->n_states + place && m->partial_column[i] < moving)
                value[k] += c->partial[i] * c->dx[m->partial_column[i]];
    }
    for (size_t k = 0; k < n; k++)
        if (!hc_is_finite(value[k]))
            return hc_discard(c, "a derivative of an output is not finite at time %.17g", c->value[0]);
    return HC_DONE;
}
