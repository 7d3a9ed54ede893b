/* Products with the partial derivatives of a corrected FMU, by the chain rule. With dx, dw, du changes of the inner FMU's
 * states, of its other knowns and of its driven inputs, dxb, dv, dp of the Block's states, inputs and parameters:
 *     du = B (dxb, dv, dp),   dy = C (dx, dw, du),   dr = A (dxb, dv, dy, dp)
 * B are the Block's rows of what it drives, A its other rows; C dx is a product that the inner FMU gives. The adjoint is
 * the transposed product, from the last to the first.
 */
#include "hc_around.h"

#include <stdlib.h>
#include <string.h>

static const hc_around_table *const table = &hc_surroundings;

/* Work space: of the Block all partial derivatives, changes of what its columns and rows stand for; of the inner FMU lists
 * of knowns and unknowns, with their values. */
typedef struct {
    double *partial, *column, *row, *known_value, *unknown_value;
    unsigned *known, *unknown;
    size_t n_known, n_unknown, known_width, unknown_width;
} products;

static int place(hc_around *c, products *w, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                 size_t n_known)
{
    const hc_model_type *m = &hc_model;
    const size_t columns = (size_t)(m->n_states + m->n_inputs + m->n_parameters), rows = (size_t)(m->n_states + m->n_outputs);
    const size_t knowns = n_known + (size_t)table->n_driven, unknowns = n_unknown + (size_t)table->n_sources;
    const size_t of_knowns = hc_around_width(known, n_known) + (size_t)table->n_driven;
    const size_t of_unknowns = hc_around_width(unknown, n_unknown) + (size_t)table->n_sources;
    const size_t values = (size_t)m->n_partials + columns + rows + of_knowns + of_unknowns;
    const size_t size = values * sizeof(double) + (knowns + unknowns) * sizeof(unsigned);
    if (size > c->room) {
        void *space = realloc(c->space, size);
        if (!space)
            return hc_around_fail(c, "no memory");
        c->space = space;
        c->room = size;
    }
    memset(c->space, 0, size);
    w->partial = c->space;
    w->column = w->partial + m->n_partials;
    w->row = w->column + columns;
    w->known_value = w->row + rows;
    w->unknown_value = w->known_value + of_knowns;
    w->known = (unsigned *)(w->unknown_value + of_unknowns);
    w->unknown = w->known + knowns;
    w->n_known = w->n_unknown = w->known_width = w->unknown_width = 0;
    return HC_DONE;
}

/* ---- what value references stand for ---- */

/* The Block's column of a known that is its own; -1: another one's. */
static int column_of(int kind, int i)
{
    const hc_model_type *m = &hc_model;
    return kind == OWN_STATE ? i : kind == GIVEN ? m->n_states + i : kind == OWN_PARAMETER ? m->n_states + m->n_inputs + i : -1;
}

/* The Block's row of an unknown that is its own, or of the k-th part added to a derivative. */
static int row_of(int kind, int i)
{
    const int outputs = hc_model.n_states + table->n_driven;
    return kind == OWN_SLOPE ? i : kind == MEASURED ? outputs + i : kind == ADDED ? outputs + table->n_measured + i : -1;
}

static int source_column(int i)
{
    return hc_model.n_states + table->n_driven + i;
}

/* Whether source i is an input that the Block drives, the inner FMU's known, or else an unknown; HC_ASKED: unknown. */
enum { HC_DRIVEN, HC_KNOWN, HC_ASKED };
static int source_kind(int i, int *driven)
{
    *driven = hc_around_find(table->driven, table->n_driven, table->source[i]);
    return *driven >= 0 && i >= table->n_early ? HC_DRIVEN : table->source_known[i] ? HC_KNOWN : HC_ASKED;
}

/* What arrives late has no effect at once. */
static void mask(hc_around *c, products *w)
{
    for (int k = 0; k < table->n_late; k++)
        if (c->history.delay[k] != 0.0)
            w->column[source_column(table->late_source[k])] = 0.0;
#if HC_DELAYS
    hc_delays_mask(c->delays, w->column + hc_model.n_states);
#endif
}

/* ---- lists of the inner FMU's variables ---- */

static void add_known(products *w, unsigned vr, size_t width, const double *value)
{
    w->known[w->n_known++] = vr;
    if (value)
        memcpy(w->known_value + w->known_width, value, width * sizeof *value);
    w->known_width += width;
}

static void add_unknown(products *w, unsigned vr, size_t width, const double *value)
{
    w->unknown[w->n_unknown++] = vr;
    if (value)
        memcpy(w->unknown_value + w->unknown_width, value, width * sizeof *value);
    w->unknown_width += width;
}

/* The inner FMU's product: of unknowns or, where `adjoint`, of knowns. */
static int inner(hc_around *c, products *w, int adjoint)
{
    double *seed = adjoint ? w->unknown_value : w->known_value, *result = adjoint ? w->known_value : w->unknown_value;
    const size_t n_seed = adjoint ? w->unknown_width : w->known_width;
    const size_t n_result = adjoint ? w->known_width : w->unknown_width;
    if (w->n_known == 0 || w->n_unknown == 0)
        return HC_DONE;
    return hc_inner_partials(c->inner, adjoint, w->unknown, w->n_unknown, w->known, w->n_known, seed, n_seed, result,
                             n_result);
}

static void multiply(products *w)
{
    const hc_model_type *m = &hc_model;
    memset(w->row, 0, (size_t)(m->n_states + m->n_outputs) * sizeof *w->row);
    for (int i = 0; i < m->n_partials; i++)
        w->row[m->partial_row[i]] += w->partial[i] * w->column[m->partial_column[i]];
}

static void multiply_transposed(products *w)
{
    const hc_model_type *m = &hc_model;
    for (int i = 0; i < m->n_partials; i++)
        w->column[m->partial_column[i]] += w->partial[i] * w->row[m->partial_row[i]];
}

/* ---- the two products ---- */

static int forward(hc_around *c, products *w, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                   size_t n_known, const double *seed, double *sensitivity)
{
    int i, driven, status;
    for (size_t k = 0; k < n_known; k++) {
        const int kind = hc_around_kind(known[k], &i), own = column_of(kind, i);
        const size_t width = kind == INNER ? hc_around_width(known + k, 1) : 1;
        if (own >= 0)
            w->column[own] += *seed;
        else
            add_known(w, known[k], width, seed);
        for (int s = 0; kind == INNER && s < table->n_sources; s++)
            if (table->source[s] == known[k] && source_kind(s, &driven) == HC_KNOWN)
                w->column[source_column(s)] += *seed;
        seed += width;
    }
    mask(c, w);
    multiply(w);
    for (int k = 0; k < table->n_driven; k++)
        add_known(w, table->driven[k], 1, w->row + hc_model.n_states + k);
    for (size_t k = 0; k < n_unknown; k++) {
        const int kind = hc_around_kind(unknown[k], &i);
        if (kind == INNER || kind == ADDED)
            add_unknown(w, unknown[k], hc_around_width(unknown + k, 1), NULL);
    }
    for (int s = 0; s < table->n_sources; s++)
        if (source_kind(s, &driven) == HC_ASKED)
            add_unknown(w, table->source[s], 1, NULL);
    status = inner(c, w, 0);
    if (status >= HC_DISCARD)
        return status;
    const double *asked = w->unknown_value + w->unknown_width, *result = w->unknown_value;
    for (int s = table->n_sources - 1; s >= 0; s--) {
        const int kind = source_kind(s, &driven);
        if (kind == HC_ASKED)
            w->column[source_column(s)] = *--asked;
        else if (kind == HC_DRIVEN)
            w->column[source_column(s)] = w->row[hc_model.n_states + driven];
    }
    mask(c, w);
    multiply(w);
    for (size_t k = 0; k < n_unknown; k++) {
        const int kind = hc_around_kind(unknown[k], &i);
        const size_t width = kind == INNER ? hc_around_width(unknown + k, 1) : 1;
        if (kind == INNER || kind == ADDED) {
            memcpy(sensitivity, result, width * sizeof *result);
            result += width;
        } else {
            *sensitivity = w->row[row_of(kind, i)];
        }
        for (int a = 0; kind == ADDED && a < table->n_added; a++)
            if (table->added[a] == unknown[k])
                *sensitivity += w->row[row_of(ADDED, a)];
        sensitivity += width;
    }
    return status;
}

static int adjoint(hc_around *c, products *w, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                   size_t n_known, const double *seed, double *sensitivity)
{
    const int outputs = hc_model.n_states;
    int i, driven, status;
    for (size_t k = 0; k < n_unknown; k++) {
        const int kind = hc_around_kind(unknown[k], &i);
        const size_t width = kind == INNER ? hc_around_width(unknown + k, 1) : 1;
        if (kind == INNER || kind == ADDED)
            add_unknown(w, unknown[k], width, seed);
        else
            w->row[row_of(kind, i)] += *seed;
        for (int a = 0; kind == ADDED && a < table->n_added; a++)
            if (table->added[a] == unknown[k])
                w->row[row_of(ADDED, a)] += *seed;
        seed += width;
    }
    multiply_transposed(w);
    mask(c, w);
    for (int s = 0; s < table->n_sources; s++)
        if (source_kind(s, &driven) == HC_ASKED)
            add_unknown(w, table->source[s], 1, w->column + source_column(s));
    for (size_t k = 0; k < n_known; k++)
        if (hc_around_kind(known[k], &i) == INNER)
            add_known(w, known[k], hc_around_width(known + k, 1), NULL);
    for (int k = 0; k < table->n_driven; k++)
        add_known(w, table->driven[k], 1, NULL);
    status = inner(c, w, 1);
    if (status >= HC_DISCARD)
        return status;
    const double *result = w->known_value, *of_driven = result + w->known_width - table->n_driven;
    memset(w->row, 0, (size_t)(hc_model.n_states + hc_model.n_outputs) * sizeof *w->row);
    memcpy(w->row + outputs, of_driven, (size_t)table->n_driven * sizeof *of_driven);
    for (int s = 0; s < table->n_sources; s++)
        if (source_kind(s, &driven) == HC_DRIVEN)
            w->row[outputs + driven] += w->column[source_column(s)];
    multiply_transposed(w);
    mask(c, w);
    for (size_t k = 0; k < n_known; k++) {
        const int kind = hc_around_kind(known[k], &i), own = column_of(kind, i);
        const size_t width = kind == INNER ? hc_around_width(known + k, 1) : 1;
        if (own >= 0) {
            *sensitivity = w->column[own];
        } else {
            memcpy(sensitivity, result, width * sizeof *result);
            result += width;
        }
        for (int s = 0; kind == INNER && s < table->n_sources; s++)
            if (table->source[s] == known[k] && source_kind(s, &driven) == HC_KNOWN)
                *sensitivity += w->column[source_column(s)];
        sensitivity += width;
    }
    return status;
}

int hc_around_partials(hc_around *c, int transposed, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                       size_t n_known, const double *seed, double *sensitivity)
{
    products w;
    int i, status;
    if (!table->differentiable)
        return hc_around_fail(c, "not supported: partial derivatives; the FMU inside gives none that are needed");
    if ((n_unknown > 0 && !unknown) || (n_known > 0 && !known) || !seed || !sensitivity)
        return hc_around_fail(c, "unknowns, knowns, seed or sensitivity is NULL");
    for (size_t k = 0; k < n_unknown; k++) {
        const int kind = hc_around_kind(unknown[k], &i);
        if (kind != INNER && row_of(kind, i) < 0)
            return hc_around_fail(c, "value reference %u is no unknown", unknown[k]);
    }
    for (size_t k = 0; k < n_known; k++) {
        const int kind = hc_around_kind(known[k], &i);
        if (kind != INNER && column_of(kind, i) < 0)
            return hc_around_fail(c, "value reference %u is no known", known[k]);
    }
    status = hc_around_evaluate(c);
    if (status < HC_DISCARD)
        status = place(c, &w, unknown, n_unknown, known, n_known);
    if (status >= HC_DISCARD)
        return hc_around_passed(c, status);
    if (hc_model.n_partials > 0)
        hc_model.partials(hc_around_time(c), c->x, c->in, c->p, NULL, w.partial);
    status = (transposed ? adjoint : forward)(c, &w, unknown, n_unknown, known, n_known, seed, sensitivity);
    return hc_around_passed(c, status);
}
