/* The variables of an instance: their kinds, lazy evaluation of their values, and setting them. */
#include "hc_instance_internal.h"

#include <stdio.h>
#include <string.h>

#include "hc_friction.h"

/* ---- kinds of variables ---- */

/* Name of a kind of variable, for messages. */
const char *hc_called(const hc_instance *c, unsigned vr, char text[200])
{
    static const char *const words[] = {"time",   "state",           "derivative",    "input", "parameter",
                                        "output", "event indicator", "friction mode", ""};
    const int kind = hc_kind_of(c, vr);
    const unsigned i = kind < UNKNOWN ? vr - c->first[kind] : 0;
    const char *const *names = hc_description.names;
    if (kind == TIME)
        return "time";
    if (kind == UNKNOWN)
        snprintf(text, 200, "value reference %u", vr);
    else if (kind >= INDICATOR)
        snprintf(text, 200, "%s of %.150s", words[kind], names[c->model->friction_state[i]]);
    else if (kind == DERIVATIVE)
        snprintf(text, 200, "derivative der(%.150s)", names[i]);
    else
        snprintf(text, 200, "%s %.150s", words[kind], names[hc_place_of(c, kind, vr)]);
    return text;
}

int hc_fail_at(hc_instance *c, unsigned vr, const char *what)
{
    char text[200];
    if (hc_kind_of(c, vr) == UNKNOWN)
        return hc_fail(c, "unknown value reference %u; the last is %u", vr, c->first[UNKNOWN] - 1);
    return hc_fail(c, "%s (value reference %u) %s", hc_called(c, vr, text), vr, what);
}

/* ---- evaluation: each part of the values is computed on demand ---- */

int hc_find_modes(hc_instance *c)
{
    const hc_model_type *m = c->model;
    for (int k = 0; k < m->n_friction; k++) {
        const double v = c->x[m->friction_state[k]];
        c->mode[k] = v > 0.0 ? 1 : v < 0.0 ? -1 : 0;
    }
    c->valid |= VALID_MODES;
    return m->n_friction == 0 ? HC_OK : hc_friction_modes(m, hc_instance_time(c), c->x, c->in, c->p, c->mode, c->a, c->b);
}

/* In Co-Simulation the states and modes are read inside the solver's last step, when they are needed. */
void hc_read_states(hc_instance *c)
{
    if (!(c->valid & VALID_STATES)) {
        const int *mode = hc_solver_inside(c->solver, c->value[0], c->x);
        memcpy(c->mode, mode, (size_t)c->model->n_friction * sizeof *mode);
        c->valid |= VALID_STATES | VALID_MODES;
    }
    if (!(c->valid & VALID_MODES))
        hc_find_modes(c);
}

/* Event indicators: positive in the mode of each friction, and not zero right after an event. Slipping: the velocity in
 * its direction; sticking: |b| - |a|, the reserve of the friction. */
static void evaluate_indicators(hc_instance *c)
{
    const hc_model_type *m = c->model;
    if (m->n_friction > 0)
        m->friction(hc_instance_time(c), c->x, c->in, c->p, c->mode, c->a, c->b);
    for (int k = 0; k < m->n_friction; k++) {
        const int i = m->friction_state[k];
        if (c->mode[k] != 0)
            c->z[k] = c->mode[k] * c->x[i] + HC_HYSTERESIS * hc_description.nominal[i];
        else
            c->z[k] = HC_HYSTERESIS * fabs(c->b[k]) - hc_friction_excess(c->a[k], c->b[k]);
    }
}

void hc_evaluate(hc_instance *c, int kind)
{
    const hc_model_type *m = c->model;
    if (kind == TIME || kind == INPUT || kind == PARAMETER)
        return;
    hc_read_states(c);
    if (kind == DERIVATIVE && !(c->valid & VALID_DX)) {
        m->derivatives(hc_instance_time(c), c->x, c->in, c->p, c->mode, c->dx);
        c->valid |= VALID_DX;
    } else if (kind == OUTPUT && !(c->valid & VALID_Y)) {
        m->outputs(hc_instance_time(c), c->x, c->in, c->p, c->mode, c->y);
        c->valid |= VALID_Y;
    } else if (kind == INDICATOR && !(c->valid & VALID_Z)) {
        evaluate_indicators(c);
        c->valid |= VALID_Z;
    }
}

/* HC_DISCARD if a value from `first` on is not finite: an integrator can try a shorter step. */
int hc_check_finite(hc_instance *c, unsigned vr)
{
    char text[200];
    if (hc_is_finite(c->value[vr]) || c->state & (HC_TERMINATED | HC_FAILED))
        return HC_DONE;
    return hc_discard(c, "%s is not finite at time %.17g", hc_called(c, vr, text), c->value[0]);
}

/* ---- values ---- */

int hc_get_reals(hc_instance *c, const unsigned *vr, size_t n, double *value)
{
    int status = HC_DONE;
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++) {
        const int kind = hc_kind_of(c, vr[i]);
        if (kind == UNKNOWN)
            return hc_fail_at(c, vr[i], "");
        if (kind == MODE)
            return hc_fail_at(c, vr[i], "is a whole number, not a real one");
        hc_evaluate(c, kind);
        if (!hc_is_finite(c->value[vr[i]]) && hc_check_finite(c, vr[i]) != HC_DONE)
            status = HC_DISCARD;
        value[i] = c->value[vr[i]];
    }
    return status;
}

int hc_get_modes(hc_instance *c, const unsigned *vr, size_t n, int *value)
{
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++) {
        if (hc_kind_of(c, vr[i]) != MODE)
            return hc_fail_at(c, vr[i], "is a real number, not a whole one");
        hc_read_states(c);
        value[i] = c->mode[vr[i] - c->first[MODE]];
    }
    return HC_DONE;
}

int hc_no_variable(hc_instance *c, const char *type, const unsigned *vr, size_t n)
{
    char text[200];
    if (n == 0)
        return HC_DONE;
    if (!vr)
        return hc_no_null(c, vr, "valueReferences", n);
    if (hc_kind_of(c, vr[0]) == UNKNOWN)
        return hc_fail_at(c, vr[0], "");
    return hc_fail(c, "%s (value reference %u) is no %s variable that this function serves", hc_called(c, vr[0], text),
                   vr[0], type);
}

static unsigned settable_kinds(const hc_instance *c)
{
    switch (c->state) {
    case HC_INSTANTIATED:
    case HC_INITIALIZATION:
        return 1u << STATE | 1u << INPUT | 1u << PARAMETER;
    case HC_EVENT:
        return 1u << INPUT | 1u << PARAMETER;
    case HC_CONTINUOUS_TIME:
        return 1u << INPUT | 1u << STATE;
    case HC_STEP:
        return 1u << INPUT | (c->event_mode_used ? 0 : 1u << PARAMETER);
    default:
        return 0;
    }
}

/* The value to be set: the bound if it is outside by rounding only. */
static double within(unsigned i, double value)
{
    const double lower = hc_description.lower[i], upper = hc_description.upper[i], room = hc_description.room[i];
    return value < lower && value >= lower - room ? lower : value > upper && value <= upper + room ? upper : value;
}

/* Check of a value outside its bounds: HC_DONE if it is outside by rounding only or the equations clip it (logged
 * once), otherwise an error. */
static int check_bounds(hc_instance *c, unsigned vr, unsigned i, double value)
{
    char text[200];
    const double lower = hc_description.lower[i], upper = hc_description.upper[i], set = within(i, value);
    const int outside = set < lower || set > upper;
    if (set == value && !outside)
        return HC_DONE;
    if (outside && !hc_description.saturates[i])
        return hc_fail(c, "%s is set to %.17g, outside its bounds [%.17g, %.17g]", hc_called(c, vr, text), value, lower,
                       upper);
    if (!c->told[i])
        hc_log_message(&c->log, HC_WARNING, c->function,
                       "%s is set to %.17g, outside its bounds [%.17g, %.17g]: it acts as the bound; not told again",
                       hc_called(c, vr, text), value, lower, upper);
    c->told[i] = 1;
    return HC_DONE;
}

/* An error, or HC_DONE if the value may be set. */
static int check_value(hc_instance *c, unsigned settable, unsigned vr, double value)
{
    char text[200], state[40];
    const int kind = hc_kind_of(c, vr);
    unsigned i;
    if (kind == UNKNOWN)
        return hc_fail_at(c, vr, "");
    if (!(settable >> kind & 1u)) {
        hc_name_states(c, c->state, state, sizeof state);
        if (kind != STATE && kind != INPUT && kind != PARAMETER)
            return hc_fail_at(c, vr, "cannot be set");
        return hc_fail(c, "%s cannot be set in the state %s", hc_called(c, vr, text), state);
    }
    i = hc_place_of(c, kind, vr);
    if (!hc_is_finite(value))
        return hc_fail(c, "%s is set to %s", hc_called(c, vr, text), value != value ? "NaN" : "an infinite value");
    if (check_bounds(c, vr, i, value) != HC_DONE)
        return HC_ERROR;
#if HC_DELAYS
    if (hc_refuse_late(c, kind, vr, value) != HC_DONE)
        return HC_ERROR;
#endif
    return HC_DONE;
}

void hc_invalidate(hc_instance *c)
{
    c->valid &= VALID_STATES | VALID_MODES;
    if (c->state != HC_CONTINUOUS_TIME && !(c->kind == HC_MODEL_EXCHANGE && c->state == HC_EVENT))
        c->valid &= ~(unsigned)VALID_MODES; /* in other states modes change only at events */
}

static double value_to_set(const hc_instance *c, unsigned vr, double value)
{
    return within(hc_place_of(c, hc_kind_of(c, vr), vr), value);
}

int hc_set_reals(hc_instance *c, const unsigned *vr, size_t n, const double *value)
{
    const unsigned settable = settable_kinds(c);
    int differs = 0;
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++)
        if (check_value(c, settable, vr[i], value[i]) != HC_DONE)
            return HC_ERROR;
    for (size_t i = 0; i < n; i++)
        differs |= c->value[vr[i]] != value_to_set(c, vr[i], value[i]);
    if (!differs)
        return HC_DONE;
    hc_read_states(c); /* first read the states that the solver reached with the old values */
    for (size_t i = 0; i < n; i++)
        c->value[vr[i]] = value_to_set(c, vr[i], value[i]);
    hc_invalidate(c);
    c->changed = 1;
    return hc_take_inputs(c);
}
