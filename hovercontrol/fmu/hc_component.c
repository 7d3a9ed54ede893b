/* One instance of an FMU: see hc_component.h. In sections: messages, life, evaluation, values, partial derivatives,
 * Model Exchange and its events, Co-Simulation, the whole state.
 */
#include "hc_component.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "hc_friction.h"
#include "hc_solver_internal.h"

#define ROOM (8.0 * DBL_EPSILON) /* relative: from a switch to the times at which the model is asked */
#define AT_SWITCH 1e-12          /* relative: an event this little before a switch is at it */
#define HYSTERESIS 1e-9          /* of the velocity's nominal size, and of the largest friction |b| */
#define AHEAD 100.0              /* communication steps that the solver may be ahead: forces at rest are sampled */
#define MAX_STEPS 10000000L      /* of the solver in one communication step, some seconds */

enum { TIME = 0, STATE, DERIVATIVE, INPUT, PARAMETER, OUTPUT, INDICATOR, MODE, UNKNOWN };
enum { VALID_STATES = 1, VALID_MODES = 2, VALID_DX = 4, VALID_Y = 8, VALID_Z = 16, VALID_PARTIALS = 32 };

/* ---- messages ---- */

static const char *const category_names[] = {"logEvents", "logStatusWarning", "logStatusDiscard", "logStatusError"};
#define N_CATEGORIES 4
#define ALL_CATEGORIES 15u

static void log_text(const hc_log_type *log, int status, const char *function, const char *format, va_list values)
{
    char text[600];
    int n = 0;
    if (!log->callback || !(log->categories >> status & 1u))
        return;
    if (function)
        n = snprintf(text, sizeof text, "%s: ", function);
    if (n >= 0 && (size_t)n < sizeof text)
        vsnprintf(text + n, sizeof text - (size_t)n, format, values);
    log->emit(log, status, category_names[status], text);
}

static void HC_FORMAT(4, 5)
    log_message(const hc_log_type *log, int status, const char *function, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    log_text(log, status, function, format, values);
    va_end(values);
}

int hc_fail(hc_component *c, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    log_text(&c->log, HC_ERROR, c->function, format, values);
    va_end(values);
    c->state = HC_FAILED;
    return HC_ERROR;
}

int hc_discard(hc_component *c, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    log_text(&c->log, HC_DISCARD, c->function, format, values);
    va_end(values);
    return HC_DISCARD;
}

int hc_not_supported(hc_component *c, const char *what)
{
    return hc_fail(c, "not supported: %s", what);
}

int hc_no_null(hc_component *c, const void *pointer, const char *name, size_t n)
{
    if (n == 0 || pointer)
        return HC_DONE;
    return hc_fail(c, "%s is NULL where a pointer is needed", name);
}

static void name_states(const hc_component *c, unsigned states, char *text, size_t size)
{
    static const char *const names[] = {"Instantiated", "Initialization Mode", "Event Mode", "Continuous-Time Mode",
                                        NULL,           "Terminated",          "Error"};
    size_t n = 0;
    text[0] = '\0';
    for (int i = 0; i < 7; i++)
        if (states >> i & 1u && n < size) {
            const char *name = names[i] ? names[i] : c->log.version == 2 ? "Step Complete" : "Step Mode";
            const int more = snprintf(text + n, size - n, "%s%s", n > 0 ? ", " : "", name);
            n += more > 0 ? (size_t)more : 0;
        }
}

int hc_refuse_state(hc_component *c, unsigned allowed)
{
    char now[40], where[160];
    name_states(c, c->state, now, sizeof now);
    name_states(c, allowed & ~(unsigned)HC_FAILED, where, sizeof where);
    if (c->state == HC_FAILED)
        hc_fail(c, "not allowed after an error: reset the instance, restore a state of it, or free it");
    else
        hc_fail(c, "not allowed in the state %s; allowed in: %s", now, where[0] ? where : "none");
    return 0;
}

int hc_refuse_kind(hc_component *c, int kind)
{
    hc_fail(c, "only for %s; this instance is of the other kind",
            kind == HC_MODEL_EXCHANGE ? "Model Exchange" : "Co-Simulation");
    return 0;
}

int hc_set_logging(hc_component *c, int on, int only, size_t n, const char *const categories[])
{
    unsigned chosen = n == 0 ? ALL_CATEGORIES : 0;
    if (hc_no_null(c, categories, "categories", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++) {
        unsigned found = 0;
        for (int k = 0; k < N_CATEGORIES && categories[i]; k++)
            if (strcmp(categories[i], category_names[k]) == 0)
                found = 1u << k;
        if (categories[i] && strcmp(categories[i], "logAll") == 0)
            found = ALL_CATEGORIES;
        if (!found)
            return hc_fail(c,
                           "unknown log category \"%.60s\"; known: logEvents, logStatusWarning, logStatusDiscard, "
                           "logStatusError, logAll",
                           categories[i] ? categories[i] : "NULL");
        chosen |= found;
    }
    c->log.categories = on ? chosen | (only ? 0 : c->log.categories) : c->log.categories & ~chosen;
    return HC_DONE;
}

/* ---- what the variables are ---- */

static int kind_of(const hc_component *c, unsigned vr)
{
    for (int kind = TIME; kind <= MODE; kind++)
        if (vr < c->first[kind + 1])
            return kind;
    return UNKNOWN;
}

/* Place of a state, input or parameter in the arrays of the description. */
static unsigned place_of(const hc_component *c, int kind, unsigned vr)
{
    return vr - 1u - (kind == STATE ? 0u : (unsigned)c->model->n_states);
}

/* As a person would call it, for messages. */
static const char *called(const hc_component *c, unsigned vr, char text[200])
{
    static const char *const words[] = {"time",   "state",           "derivative",    "input", "parameter",
                                        "output", "event indicator", "friction mode", ""};
    const int kind = kind_of(c, vr);
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
        snprintf(text, 200, "%s %.150s", words[kind], names[place_of(c, kind, vr)]);
    return text;
}

static int fail_at(hc_component *c, unsigned vr, const char *what)
{
    char text[200];
    if (kind_of(c, vr) == UNKNOWN)
        return hc_fail(c, "unknown value reference %u; the last is %u", vr, c->first[UNKNOWN] - 1);
    return hc_fail(c, "%s (value reference %u) %s", called(c, vr, text), vr, what);
}

/* ---- life ---- */

static size_t count_state(const hc_component *c);
static int take_inputs(hc_component *c);
static void transfer(hc_component *c, double *buffer, int load);

static int is_blank(const char *text)
{
    return text[strspn(text, " \t\r\n")] == '\0';
}

static double *take(double **block, int n)
{
    double *here = *block;
    *block += n;
    return here;
}

static hc_component *allocate(const hc_log_type *log, int kind, const char *name)
{
    const hc_model_type *m = &hc_model;
    const int n = m->n_states, k = m->n_friction, known = n + m->n_inputs + m->n_parameters;
    const int sizes[] = {1, n, n, m->n_inputs, m->n_parameters, m->n_outputs, k, k};
    const size_t real = (size_t)(1 + 2 * n + m->n_inputs + m->n_parameters + m->n_outputs + k);
    const size_t work = (size_t)(2 * k + m->n_partials + known + n + m->n_outputs);
    hc_component *c = calloc(1, sizeof *c);
    double *block = calloc(real + work + hc_ticks_size(m), sizeof *block);
    if (!c || !block) {
        free(c);
        free(block);
        return NULL;
    }
    c->model = m;
    c->kind = kind;
    for (int i = 0; i < 8; i++)
        c->first[i + 1] = c->first[i] + (unsigned)sizes[i];
    c->value = take(&block, 1);
    c->x = take(&block, n);
    c->dx = take(&block, n);
    c->u = take(&block, m->n_inputs);
    c->p = take(&block, m->n_parameters);
    c->y = take(&block, m->n_outputs);
    c->z = take(&block, k);
    c->a = take(&block, k);
    c->b = take(&block, k);
    c->partial = take(&block, m->n_partials);
    c->seed = take(&block, known);
    c->product = take(&block, n + m->n_outputs);
    hc_ticks_place(&c->ticks, m, block);
    c->mode = calloc(2 * (size_t)k + 1, sizeof *c->mode);
    c->name = malloc(strlen(name) + 1);
    if (kind == HC_CO_SIMULATION) {
        const hc_options options = {HC_DORMAND_PRINCE, hc_description.rtol, hc_description.atol, 0.0, 0,
                                    hc_description.nominal};
        c->solver = hc_solver_new(m, &options);
        if (c->solver)
            c->solver->short_steps = 1;
    }
    c->in = c->u;
#if HC_DELAYS
    c->delays = hc_delays_new(m->n_inputs);
    if (!c->delays) {
        hc_component_free(c);
        return NULL;
    }
    c->in = hc_delays_inputs(c->delays);
#endif
    c->initial = calloc(c->solver || kind == HC_MODEL_EXCHANGE ? count_state(c) : 1, sizeof *c->initial);
    if (!c->mode || !c->name || !c->initial || (kind == HC_CO_SIMULATION && !c->solver)) {
        hc_component_free(c);
        return NULL;
    }
    c->mode_before = c->mode + k;
    memcpy(c->name, name, strlen(name) + 1);
    c->log = *log;
    c->log.instance = c->name;
    return c;
}

hc_component *hc_component_new(const hc_log_type *log, const char *function, int kind, const char *name,
                               const char *token)
{
    const hc_model_type *m = &hc_model;
    hc_component *c;
    if (!name || is_blank(name)) {
        log_message(log, HC_ERROR, function, "the instance needs a name");
        return NULL;
    }
    if (!token || strcmp(token, hc_description.token) != 0) {
        log_message(log, HC_ERROR, function,
                    "the instantiation token is \"%.100s\", but that of this binary is \"%.100s\"",
                    token ? token : "NULL", hc_description.token);
        return NULL;
    }
    c = allocate(log, kind, name);
    if (!c) {
        log_message(log, HC_ERROR, function, "no memory");
        return NULL;
    }
    c->function = function;
    c->state = HC_INSTANTIATED;
    c->earliest = -DBL_MAX;
    c->latest = c->next_switch = c->stop_time = DBL_MAX;
    c->rtol = hc_description.rtol;
    for (int i = 0; i < m->n_states; i++)
        c->x[i] = hc_description.start[i];
    for (int i = 0; i < m->n_inputs; i++)
        c->u[i] = hc_description.start[m->n_states + i];
    for (int i = 0; i < m->n_parameters; i++)
        c->p[i] = hc_description.start[m->n_states + m->n_inputs + i];
    c->valid = VALID_STATES;
    c->changed = 1;
    take_inputs(c);
    transfer(c, c->initial, 0);
    return c;
}

void hc_component_free(hc_component *c)
{
    if (!c)
        return;
    hc_solver_free(c->solver);
#if HC_DELAYS
    hc_delays_free(c->delays);
#endif
    free(c->initial);
    free(c->name);
    free(c->mode);
    free(c->value);
    free(c);
}

int hc_reset(hc_component *c)
{
    transfer(c, c->initial, 1);
    return HC_DONE;
}

int hc_set_experiment(hc_component *c, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    if (has_tolerance && !(hc_is_finite(tolerance) && tolerance > 0.0))
        return hc_fail(c, "the tolerance is %g; it must be positive", tolerance);
    if (!hc_is_finite(start))
        return hc_fail(c, "the start time is %g; it must be a number", start);
    if (has_stop && !(stop >= start))
        return hc_fail(c, "the stop time %.17g is before the start time %.17g", stop, start);
    if (has_tolerance && c->solver) {
        c->rtol = tolerance;
        hc_solver_tolerance(c->solver, tolerance, tolerance * (hc_description.atol / hc_description.rtol),
                            hc_description.nominal);
    }
    c->start_time = c->value[0] = start;
    c->stop_time = has_stop && hc_is_finite(stop) ? stop : DBL_MAX;
    c->valid = VALID_STATES;
    return HC_DONE;
}

/* ---- evaluation: each part of the values is computed when it is asked for ---- */

static double model_time(const hc_component *c)
{
    const double t = c->value[0];
    return t < c->earliest ? c->earliest : t > c->latest ? c->latest : t;
}

static int find_modes(hc_component *c)
{
    const hc_model_type *m = c->model;
    for (int k = 0; k < m->n_friction; k++) {
        const double v = c->x[m->friction_state[k]];
        c->mode[k] = v > 0.0 ? 1 : v < 0.0 ? -1 : 0;
    }
    c->valid |= VALID_MODES;
    return m->n_friction == 0 ? HC_OK : hc_friction_modes(m, model_time(c), c->x, c->in, c->p, c->mode, c->a, c->b);
}

/* In Co-Simulation the states and modes are read inside the solver's last step, when they are needed. */
static void read_states(hc_component *c)
{
    if (!(c->valid & VALID_STATES)) {
        const int *mode = hc_solver_inside(c->solver, c->value[0], c->x);
        memcpy(c->mode, mode, (size_t)c->model->n_friction * sizeof *mode);
        c->valid |= VALID_STATES | VALID_MODES;
    }
    if (!(c->valid & VALID_MODES))
        find_modes(c);
}

/* Positive in the mode of each friction, and never zero right after an event. Slipping: the velocity, in its
 * direction; sticking: what the friction can hold beyond the force. */
static void evaluate_indicators(hc_component *c)
{
    const hc_model_type *m = c->model;
    if (m->n_friction > 0)
        m->friction(model_time(c), c->x, c->in, c->p, c->mode, c->a, c->b);
    for (int k = 0; k < m->n_friction; k++) {
        const int i = m->friction_state[k];
        if (c->mode[k] != 0)
            c->z[k] = c->mode[k] * c->x[i] + HYSTERESIS * hc_description.nominal[i];
        else
            c->z[k] = HYSTERESIS * fabs(c->b[k]) - hc_friction_excess(c->a[k], c->b[k]);
    }
}

static void evaluate(hc_component *c, int kind)
{
    const hc_model_type *m = c->model;
    if (kind == TIME || kind == INPUT || kind == PARAMETER)
        return;
    read_states(c);
    if (kind == DERIVATIVE && !(c->valid & VALID_DX)) {
        m->derivatives(model_time(c), c->x, c->in, c->p, c->mode, c->dx);
        c->valid |= VALID_DX;
    } else if (kind == OUTPUT && !(c->valid & VALID_Y)) {
        m->outputs(model_time(c), c->x, c->in, c->p, c->mode, c->y);
        c->valid |= VALID_Y;
    } else if (kind == INDICATOR && !(c->valid & VALID_Z)) {
        evaluate_indicators(c);
        c->valid |= VALID_Z;
    }
}

/* HC_DISCARD where value i from `first` on is no number: an integrator can try a shorter step. */
static int check_finite(hc_component *c, unsigned vr)
{
    char text[200];
    if (hc_is_finite(c->value[vr]) || c->state & (HC_TERMINATED | HC_FAILED))
        return HC_DONE;
    return hc_discard(c, "%s is not finite at time %.17g", called(c, vr, text), c->value[0]);
}

static int fail_ticks(hc_component *c)
{
    return hc_fail(c, "what ticks at time %.17g set is not finite", c->value[0]);
}

/* Hand the solver what was set; ticks of this time are taken, or taken again. */
static int tell_solver(hc_component *c)
{
    hc_solver *s = c->solver;
    const int goes_on = c->model->n_ticks > 0 && s->started && s->t == c->value[0];
    const int status = hc_solver_set(s, c->value[0], goes_on ? NULL : c->x, c->in, c->p);
    c->changed = c->event = 0;
    if (c->model->n_ticks > 0) {
        c->valid = 0;
        read_states(c);
    }
    return status;
}

#if HC_DELAYS
/* Before initialization ends late inputs are at rest; what they have then is sent. */
static int begin_delays(hc_component *c)
{
    const double *start = hc_description.start + c->model->n_states;
    const int wrong = hc_delays_rest(c->delays, c->u, start, c->p);
    if (wrong >= 0)
        return hc_fail(c, "the delay of input %s is negative or not finite",
                       hc_description.names[c->model->n_states + hc_late.input[wrong]]);
    return hc_delays_send(c->delays, c->value[0], c->u) ? HC_DONE : hc_fail(c, "no memory");
}

/* What says how late inputs act is fixed. */
static int refuse_late(hc_component *c, int kind, unsigned vr, double value)
{
    char text[200];
    if (kind == PARAMETER && value != c->value[vr] && !(c->state & (HC_INSTANTIATED | HC_INITIALIZATION)) &&
        hc_delays_fixed((int)(vr - c->first[kind])))
        return hc_fail(c, "%s says how late an input acts: it is fixed at initialization", called(c, vr, text));
    return HC_DONE;
}
#endif

/* What the model sees of the inputs that were set. In Continuous-Time Mode an importer may try times out of order: late
 * inputs, which are discrete, wait for the next event. */
static int take_inputs(hc_component *c)
{
#if HC_DELAYS
    if (c->state & (HC_INSTANTIATED | HC_INITIALIZATION))
        hc_delays_rest(c->delays, c->u, hc_description.start + c->model->n_states, c->p);
    else if (c->state == HC_CONTINUOUS_TIME)
        hc_delays_send_prompt(c->delays, c->u);
    else if (!hc_delays_send(c->delays, c->value[0], c->u))
        return hc_fail(c, "no memory");
#else
    (void)c;
#endif
    return HC_DONE;
}

int hc_exit_initialization(hc_component *c)
{
#if HC_DELAYS
    if (begin_delays(c) != HC_DONE)
        return HC_ERROR;
#endif
    if (find_modes(c) != HC_OK)
        return hc_fail(c, "the forces at the start are not finite");
    c->updated = 0;
    c->changed = 1;
    hc_ticks_start(&c->ticks, c->value[0]);
    if (c->model->n_ticks > 0 && c->solver && tell_solver(c) != HC_OK)
        return fail_ticks(c);
    if (c->kind == HC_MODEL_EXCHANGE || c->event_mode_used)
        c->state = HC_EVENT;
    else
        c->state = HC_STEP;
    return HC_DONE;
}

/* ---- values ---- */

int hc_get_reals(hc_component *c, const unsigned *vr, size_t n, double *value)
{
    int status = HC_DONE;
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++) {
        const int kind = kind_of(c, vr[i]);
        if (kind == UNKNOWN)
            return fail_at(c, vr[i], "");
        if (kind == MODE)
            return fail_at(c, vr[i], "is a whole number, not a real one");
        evaluate(c, kind);
        if (!hc_is_finite(c->value[vr[i]]) && check_finite(c, vr[i]) != HC_DONE)
            status = HC_DISCARD;
        value[i] = c->value[vr[i]];
    }
    return status;
}

int hc_get_modes(hc_component *c, const unsigned *vr, size_t n, int *value)
{
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++) {
        if (kind_of(c, vr[i]) != MODE)
            return fail_at(c, vr[i], "is a real number, not a whole one");
        read_states(c);
        value[i] = c->mode[vr[i] - c->first[MODE]];
    }
    return HC_DONE;
}

int hc_no_variable(hc_component *c, const char *type, const unsigned *vr, size_t n)
{
    char text[200];
    if (n == 0)
        return HC_DONE;
    if (!vr)
        return hc_no_null(c, vr, "valueReferences", n);
    if (kind_of(c, vr[0]) == UNKNOWN)
        return fail_at(c, vr[0], "");
    return hc_fail(c, "%s (value reference %u) is no %s variable that this function serves", called(c, vr[0], text),
                   vr[0], type);
}

static unsigned settable_kinds(const hc_component *c)
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

/* An error, or HC_DONE if the value may be set. */
static int check_value(hc_component *c, unsigned settable, unsigned vr, double value)
{
    char text[200], state[40];
    const int kind = kind_of(c, vr);
    unsigned i;
    if (kind == UNKNOWN)
        return fail_at(c, vr, "");
    if (!(settable >> kind & 1u)) {
        name_states(c, c->state, state, sizeof state);
        if (kind != STATE && kind != INPUT && kind != PARAMETER)
            return fail_at(c, vr, "cannot be set");
        return hc_fail(c, "%s cannot be set in the state %s", called(c, vr, text), state);
    }
    i = place_of(c, kind, vr);
    if (!hc_is_finite(value))
        return hc_fail(c, "%s is set to %s", called(c, vr, text), value != value ? "NaN" : "an infinite value");
    if (value < hc_description.lower[i] || value > hc_description.upper[i])
        return hc_fail(c, "%s is set to %.17g, outside its bounds [%.17g, %.17g]", called(c, vr, text), value,
                       hc_description.lower[i], hc_description.upper[i]);
#if HC_DELAYS
    if (refuse_late(c, kind, vr, value) != HC_DONE)
        return HC_ERROR;
#endif
    return HC_DONE;
}

static void invalidate(hc_component *c)
{
    c->valid &= VALID_STATES | VALID_MODES;
    if (c->state != HC_CONTINUOUS_TIME && !(c->kind == HC_MODEL_EXCHANGE && c->state == HC_EVENT))
        c->valid &= ~(unsigned)VALID_MODES; /* else modes change only in an event */
}

int hc_set_reals(hc_component *c, const unsigned *vr, size_t n, const double *value)
{
    const unsigned settable = settable_kinds(c);
    int differs = 0;
    if (hc_no_null(c, vr, "valueReferences", n) || hc_no_null(c, value, "values", n))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++)
        if (check_value(c, settable, vr[i], value[i]) != HC_DONE)
            return HC_ERROR;
    for (size_t i = 0; i < n; i++)
        differs |= c->value[vr[i]] != value[i];
    if (!differs)
        return HC_DONE;
    read_states(c); /* with the old values, up to which the solver went */
    for (size_t i = 0; i < n; i++)
        c->value[vr[i]] = value[i];
    invalidate(c);
    c->changed = 1;
    return take_inputs(c);
}

/* ---- partial derivatives ---- */

/* Column of a known, row of an unknown; a state among the unknowns stands for the output that shows it. */
static int column_of(const hc_component *c, unsigned vr)
{
    const int kind = kind_of(c, vr);
    return kind == STATE || kind == INPUT || kind == PARAMETER ? (int)place_of(c, kind, vr) : -1;
}

static int row_of(const hc_component *c, unsigned vr)
{
    const int kind = kind_of(c, vr), n = c->model->n_states;
    return kind == DERIVATIVE ? (int)(vr - c->first[DERIVATIVE])
           : kind == OUTPUT   ? n + (int)(vr - c->first[OUTPUT])
                              : -1;
}

static int check_partials(hc_component *c, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                          size_t n_known)
{
    for (size_t i = 0; i < n_unknown; i++)
        if (kind_of(c, unknown[i]) != STATE && row_of(c, unknown[i]) < 0)
            return fail_at(c, unknown[i], "is no unknown: derivatives and outputs are");
    for (size_t i = 0; i < n_known; i++)
        if (column_of(c, known[i]) < 0)
            return fail_at(c, known[i], "is no known: states, inputs and parameters are");
    return HC_DONE;
}

int hc_partial_derivatives(hc_component *c, int adjoint, const unsigned *unknown, size_t n_unknown,
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
    read_states(c);
    if (!(c->valid & VALID_PARTIALS) && m->n_partials > 0)
        m->partials(model_time(c), c->x, c->in, c->p, c->mode, c->partial);
    c->valid |= VALID_PARTIALS;
    memset(c->seed, 0, (size_t)columns * sizeof *c->seed);
    memset(c->product, 0, (size_t)rows * sizeof *c->product);
    if (adjoint) {
        for (size_t i = 0; i < n_unknown; i++)
            if (kind_of(c, unknown[i]) == STATE)
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
        hc_delays_mask(c->delays, c->seed + m->n_states); /* what is set now acts later */
#endif
        for (int i = 0; i < m->n_partials; i++)
            c->product[m->partial_row[i]] += c->partial[i] * c->seed[m->partial_column[i]];
        for (size_t i = 0; i < n_unknown; i++)
            sensitivity[i] = kind_of(c, unknown[i]) == STATE ? c->seed[column_of(c, unknown[i])]
                                                             : c->product[row_of(c, unknown[i])];
    }
    for (size_t i = 0; i < n_sensitivity; i++)
        if (!hc_is_finite(sensitivity[i]))
            return hc_discard(c, "a partial derivative is not finite at time %.17g", c->value[0]);
    return HC_DONE;
}

/* ---- Model Exchange ---- */

int hc_set_time(hc_component *c, double time)
{
    if (!hc_is_finite(time))
        return hc_fail(c, "time is set to %s", time != time ? "NaN" : "an infinite value");
    if (time != c->value[0]) {
        c->value[0] = time;
        invalidate(c);
    }
    return HC_DONE;
}

static int check_length(hc_component *c, const void *values, size_t n, size_t expected, const char *what)
{
    if (n != expected)
        return hc_fail(c, "%zu values where there are %zu %s", n, expected, what);
    return hc_no_null(c, values, what, n);
}

int hc_set_states(hc_component *c, const double *x, size_t n)
{
    if (check_length(c, x, n, hc_n_continuous(c), "continuous states"))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++)
        if (!hc_is_finite(x[i]))
            return hc_discard(c, "state %s is set to a value that is not finite", hc_description.names[i]);
    memcpy(c->x, x, n * sizeof *x);
    invalidate(c);
    return HC_DONE;
}

int hc_get_part(hc_component *c, int part, double *into, size_t n)
{
    static const char *const words[] = {"", "continuous states", "derivatives", "", "", "", "event indicators"};
    const unsigned first = c->first[part];
    int status = HC_DONE;
    const size_t held = part == HC_STATES || part == HC_DERIVATIVES ? (size_t)c->model->n_held : 0;
    if (check_length(c, into, n, c->first[part + 1] - first - held, words[part]))
        return HC_ERROR;
    evaluate(c, part);
    for (unsigned i = 0; i < n && status == HC_DONE; i++)
        status = check_finite(c, first + i);
    if (n > 0)
        memcpy(into, c->value + first, n * sizeof *into);
    return status;
}

int hc_get_nominals(hc_component *c, double *into, size_t n)
{
    if (check_length(c, into, n, hc_n_continuous(c), "continuous states"))
        return HC_ERROR;
    if (n > 0)
        memcpy(into, hc_description.nominal, n * sizeof *into);
    return HC_DONE;
}

static int is_at_rest(const hc_component *c, int k)
{
    const int i = c->model->friction_state[k];
    return fabs(c->x[i]) <= HYSTERESIS * hc_description.nominal[i];
}

int hc_completed_step(hc_component *c, int *enter_event_mode)
{
    *enter_event_mode = 0;
    for (int k = 0; k < c->model->n_friction; k++)
        if (c->mode[k] == 0 && !is_at_rest(c, k)) /* the importer moved what sticks */
            *enter_event_mode = 1;
#if HC_DELAYS
    if (hc_delays_send_prompt(c->delays, c->u))
        *enter_event_mode = 1;
#endif
    return HC_DONE;
}

int hc_enter_event_mode(hc_component *c)
{
    if (c->kind == HC_CO_SIMULATION && !c->event_mode_used)
        return hc_fail(c, "the instance was made with eventModeUsed = false");
    read_states(c);
    c->state = HC_EVENT;
    c->updated = 0;
    return HC_DONE;
}

static void log_modes(const hc_component *c, const int *before, const int *after)
{
    static const char *const words[] = {"slips backwards", "sticks", "slips forwards"};
    for (int k = 0; k < c->model->n_friction; k++)
        if (before[k] != after[k])
            log_message(&c->log, HC_DONE, NULL, "%s %s from time %.17g on",
                        hc_description.names[c->model->friction_state[k]], words[after[k] + 1], c->value[0]);
}

/* Find the next switch by the clock; until then the model is asked for times on this side of it. */
static void look_for_switch(hc_component *c)
{
    const double t = c->value[0];
    double from = t + ROOM * fabs(t), next;
    c->earliest = -DBL_MAX;
    c->latest = c->next_switch = DBL_MAX;
    if (!c->model->next_switch)
        return;
    next = c->model->next_switch(from, c->p);
    if (next < DBL_MAX && next - t <= AT_SWITCH * fabs(next)) {
        from = next + ROOM * fabs(next);
        next = c->model->next_switch(from, c->p);
    }
    c->earliest = from;
    c->next_switch = next;
    if (next < DBL_MAX)
        c->latest = next - ROOM * fabs(next);
}

/* A velocity at or past zero is tried at zero: it sticks, or slips again to either side. */
static int update_modes(hc_component *c, int *states_changed)
{
    const hc_model_type *m = c->model;
    int *before = c->mode_before;
    memcpy(before, c->mode, (size_t)m->n_friction * sizeof *before);
    for (int k = 0; k < m->n_friction; k++) {
        double *v = c->x + m->friction_state[k];
        c->z[k] = *v; /* work space here */
        if (before[k] == 0 ? is_at_rest(c, k) : before[k] * *v <= 0.0)
            *v = 0.0;
        else
            c->mode[k] = *v > 0.0 ? 1 : -1;
    }
    if (m->n_friction > 0 &&
        hc_friction_modes(m, model_time(c), c->x, c->in, c->p, c->mode, c->a, c->b) != HC_OK)
        return hc_fail(c, "the forces are not finite at time %.17g", c->value[0]);
    for (int k = 0; k < m->n_friction; k++) {
        double *v = c->x + m->friction_state[k];
        if (before[k] != 0 && c->mode[k] == -before[k])
            *v = c->z[k]; /* it goes on to the other side, from where it is */
        *states_changed |= *v != c->z[k];
    }
    log_modes(c, before, c->mode);
    return HC_DONE;
}

/* Take the ticks that are due, or those of this time again, with what was set since. */
static int update_ticks(hc_component *c)
{
    const hc_model_type *m = c->model;
    const double t = c->value[0];
    if (hc_ticks_due(&c->ticks, t))
        hc_ticks_take(&c->ticks, t, c->x, c->in, c->p, c->mode);
    else if (c->ticks.ticked && c->ticks.at == t)
        hc_ticks_again(&c->ticks, t, c->x, c->in, c->p, c->mode);
    for (int i = m->n_states - m->n_held; i < m->n_states; i++)
        if (!hc_is_finite(c->x[i]))
            return fail_ticks(c);
    return HC_DONE;
}

int hc_update_discrete_states(hc_component *c, int *states_changed, double *next)
{
    int status = HC_DONE;
    /* Importers begin their integration afresh where states have changed. What derivatives depend on has: at ticks,
     * switches by the clock and steps of inputs. */
    const int jumps = c->changed || hc_ticks_due(&c->ticks, c->value[0]) || c->value[0] >= c->latest;
    *states_changed = c->kind == HC_MODEL_EXCHANGE && jumps;
    look_for_switch(c);
    if (c->kind == HC_MODEL_EXCHANGE) {
#if HC_DELAYS
        if (!hc_delays_send(c->delays, c->value[0], c->u))
            return hc_fail(c, "no memory");
        hc_delays_arrive(c->delays, c->value[0]);
#endif
        status = update_ticks(c);
        if (status == HC_DONE)
            status = update_modes(c, states_changed);
        c->changed = 0;
        c->valid = VALID_STATES | VALID_MODES;
    } else {
        invalidate(c);
        if (c->changed && c->model->n_ticks > 0 && tell_solver(c) != HC_OK)
            status = fail_ticks(c);
    }
    *next = c->ticks.next < c->next_switch ? c->ticks.next : c->next_switch;
#if HC_DELAYS
    if (hc_delays_next(c->delays) < *next)
        *next = hc_delays_next(c->delays);
#endif
    c->updated = 1;
    return status;
}

int hc_leave_event_mode(hc_component *c, unsigned state)
{
    if (!c->updated)
        return hc_fail(c, "the discrete states must be updated first");
    if (c->kind == HC_MODEL_EXCHANGE && c->changed) { /* set after that */
        look_for_switch(c);
        if (c->model->n_ticks > 0 && update_ticks(c) != HC_DONE)
            return HC_ERROR;
        if (c->model->n_friction > 0)
            hc_friction_modes(c->model, model_time(c), c->x, c->in, c->p, c->mode, c->a, c->b);
        c->changed = 0;
        c->valid = VALID_STATES | VALID_MODES;
    }
    c->state = state;
    return HC_DONE;
}

/* ---- Co-Simulation ---- */

static int check_step(hc_component *c, double time, double length)
{
    const double end = time + length, room = 16.0 * DBL_EPSILON * fabs(end) + 1e-6 * length;
    if (!hc_is_finite(length) || !(length > 0.0))
        return hc_fail(c, "the step size is %g; it must be positive", length);
    if (!(fabs(time - c->value[0]) <= room))
        return hc_fail(c, "the step begins at time %.17g, but the FMU is at time %.17g", time, c->value[0]);
    if (!(end > time) || !hc_is_finite(end))
        return hc_fail(c, "a step of %g does not change the time %.17g", length, time);
    if (c->stop_time < DBL_MAX && end > c->stop_time + room)
        return hc_fail(c, "the step ends at time %.17g, after the stop time %.17g", end, c->stop_time);
    return HC_DONE;
}

static int fail_step(hc_component *c, int status)
{
    const char *reason = status == HC_NOT_FINITE       ? "a derivative or a force is not finite"
                         : status == HC_STEP_TOO_SMALL ? "the tolerance cannot be met"
                                                       : "too many steps";
    c->value[0] = hc_solver_time(c->solver);
    c->valid = 0;
    read_states(c);
    return hc_fail(c, "the integration stopped at time %.17g: %s", c->value[0], reason);
}

/* The solver is past the event that ended its last step, or at the switch that did. */
static void pass_event(hc_component *c)
{
    const hc_solver *s = c->solver;
    c->event = 0;
    c->value[0] = s->t;
    log_modes(c, s->mode0, s->mode);
    if (s->t >= s->next_switch)
        log_message(&c->log, HC_DONE, NULL, "a condition on time changes at time %.17g", s->t);
}

#if HC_DELAYS
/* Let arrive what is due; the solver goes on with it. */
static int pass_arrivals(hc_component *c)
{
    if (!hc_delays_arrive(c->delays, c->solver->t))
        return HC_OK;
    c->event = 1;
    return hc_solver_set(c->solver, c->solver->t, NULL, c->in, NULL);
}

/* `stop`, or when something arrives before; the end of the step where that is there. */
static double stop_at_arrival(const hc_component *c, double stop, double end)
{
    const double next = hc_delays_next(c->delays);
    if (fabs(next - end) <= ROOM * fabs(end))
        return end;
    return next < stop ? next : stop;
}
#endif

int hc_do_step(hc_component *c, double time, double length, int *event, int *early)
{
    hc_solver *s = c->solver;
    const double end = time + length;
    double stop = end;
    int status = HC_OK;
    *event = *early = 0;
    if (check_step(c, time, length) != HC_DONE)
        return HC_ERROR;
    c->earliest = -DBL_MAX;
    c->latest = DBL_MAX;
    if (!(c->changed && c->changed_before)) { /* values stay for a while: the solver need not stop at the end */
        stop = end + AHEAD * length < c->stop_time ? end + AHEAD * length : c->stop_time;
        stop = stop > end ? stop : end;
    }
    c->changed_before = c->changed;
    if (c->changed) {
        read_states(c);
        status = tell_solver(c);
        if (status != HC_OK)
            return fail_step(c, status);
    }
    for (long steps = 0;; steps++) {
#if HC_DELAYS
        if (s->t <= end && (status = pass_arrivals(c)) != HC_OK)
            return fail_step(c, status);
#endif
        if (c->event && s->t <= end) {
            pass_event(c);
            *event = c->event_mode_used && (c->early_return_allowed || s->t == end);
            if (*event) {
                *early = s->t < end;
                if (s->t >= s->next_switch) /* which is not passed before the discrete states are updated */
                    c->latest = s->t - ROOM * fabs(s->t);
                c->valid = 0;
                return HC_DONE;
            }
        }
        if (s->t >= end)
            break;
        if (steps > MAX_STEPS)
            return fail_step(c, HC_TOO_MANY_STEPS);
        const long events = s->counts[HC_EVENTS];
        if (hc_ticks_due(&s->ticks, end) && !hc_ticks_before(&s->ticks, end))
            stop = end; /* ticks of that time see inputs that are set then */
#if HC_DELAYS
        status = hc_solver_step(s, stop_at_arrival(c, stop, end));
#else
        status = hc_solver_step(s, stop);
#endif
        c->event = s->counts[HC_EVENTS] != events || s->t >= s->next_switch;
        if (status != HC_OK && s->t > end) { /* what failed may never come: begin the next step anew */
            c->value[0] = end;
            c->valid = 0;
            read_states(c);
            c->changed = c->changed_before = 1;
            c->event = 0;
        } else if (status != HC_OK && stop > end) {
            stop = end;
            hc_solver_restart(s);
        } else if (status != HC_OK) {
            return fail_step(c, status);
        }
    }
    c->value[0] = end;
    if (!c->changed)
        c->valid = 0;
    return HC_DONE;
}

/* ---- the whole state ---- */

typedef struct {
    size_t count;
    double value[];
} state_type;

#define FORMAT 1 /* of the bytes below; the head is five numbers of 8 bytes */
#define HEAD 40u

static void copy(double *own, int n, double **buffer, int load)
{
    memcpy(load ? own : *buffer, load ? *buffer : own, (size_t)n * sizeof *own);
    *buffer += n;
}

enum { N_NUMBERS = 8, N_WHOLE = 8 };

/* Copy all that the instance knows to the buffer, or from it; what is under way comes last. */
static void transfer(hc_component *c, double *buffer, int load)
{
    const hc_model_type *m = c->model;
    double *const numbers[N_NUMBERS] = {&c->earliest,   &c->latest,    &c->next_switch,
                                        &c->start_time, &c->stop_time, &c->rtol,
                                        &c->ticks.next, &c->ticks.at};
    double whole[N_WHOLE] = {c->kind,    c->state,          c->valid, c->updated,
                             c->changed, c->changed_before, c->event, c->ticks.ticked};
    copy(whole, N_WHOLE, &buffer, load);
    for (int i = 0; i < N_NUMBERS; i++)
        copy(numbers[i], 1, &buffer, load);
    copy(c->value, 1, &buffer, load);
    copy(c->x, m->n_states, &buffer, load);
    copy(c->u, m->n_inputs, &buffer, load);
    copy(c->p, m->n_parameters, &buffer, load);
    copy(c->ticks.due, (int)hc_ticks_size(m), &buffer, load);
    for (int k = 0; k < m->n_friction; k++) {
        double mode = c->mode[k];
        copy(&mode, 1, &buffer, load);
        c->mode[k] = (int)mode;
    }
    if (load) {
        c->state = (unsigned)whole[1];
        c->valid = (unsigned)whole[2] & (VALID_STATES | VALID_MODES);
        c->updated = (int)whole[3];
        c->changed = (int)whole[4];
        c->changed_before = (int)whole[5];
        c->event = (int)whole[6];
        c->ticks.ticked = (int)whole[7];
        if (c->solver)
            hc_solver_load(c->solver, buffer);
    } else if (c->solver) {
        hc_solver_save(c->solver, buffer);
    }
#if HC_DELAYS
    buffer += c->solver ? hc_solver_size(c->solver) : 0;
    if (load)
        hc_delays_load(c->delays, buffer);
    else
        hc_delays_save(c->delays, buffer);
#endif
}

/* Without what is under way. */
static size_t count_fixed(const hc_component *c)
{
    const hc_model_type *m = c->model;
    return N_WHOLE + N_NUMBERS + 1 + (size_t)(m->n_states + m->n_inputs + m->n_parameters + m->n_friction) +
           hc_ticks_size(m) +
           (c->solver ? hc_solver_size(c->solver) : 0);
}

static size_t count_state(const hc_component *c)
{
#if HC_DELAYS
    return count_fixed(c) + hc_delays_count(c->delays);
#else
    return count_fixed(c);
#endif
}

/* Whether a state can be one of this instance; then there is room for it, too. */
static int fits(hc_component *c, const state_type *state)
{
#if HC_DELAYS
    const size_t fixed = count_fixed(c);
    if (state->count <= fixed || !hc_delays_fit(c->delays, state->value + fixed, state->count - fixed))
        return 0;
#else
    if (state->count != count_state(c))
        return 0;
#endif
    return state->value[0] == c->kind;
}

/* Memory for `count` numbers at *state, which may have some already; NULL, with a message, if there is none. */
static state_type *room_for(hc_component *c, void **state, size_t count)
{
    state_type *made = *state;
    if (made && made->count != count) {
#if HC_DELAYS
        free(made);
        *state = made = NULL;
#else
        hc_fail(c, "the FMU state to overwrite belongs to another kind of instance");
        return NULL;
#endif
    }
    if (!made)
        made = malloc(sizeof *made + count * sizeof(double));
    if (!made) {
        hc_fail(c, "no memory");
        return NULL;
    }
    made->count = count;
    *state = made;
    return made;
}

int hc_state_get(hc_component *c, void **state)
{
    const size_t count = count_state(c);
    state_type *made;
    if (hc_no_null(c, state, "FMUState", 1))
        return HC_ERROR;
    made = room_for(c, state, count);
    if (!made)
        return HC_ERROR;
    transfer(c, made->value, 0);
    return HC_DONE;
}

/* An error where the state is missing or of an instance of the other kind. */
static int check_state(hc_component *c, const state_type *state)
{
    if (hc_no_null(c, state, "FMUState", 1))
        return HC_ERROR;
    if (!fits(c, state))
        return hc_fail(c, "the FMU state is of another kind of instance: Model Exchange and Co-Simulation differ");
    return HC_DONE;
}

int hc_state_set(hc_component *c, const void *state)
{
    if (check_state(c, state))
        return HC_ERROR;
    transfer(c, ((state_type *)state)->value, 1);
    return HC_DONE;
}

int hc_state_free(hc_component *c, void **state)
{
    (void)c;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return HC_DONE;
}

/* FNV-1a, 64 bits */
static uint64_t digest(const unsigned char *bytes, size_t n, uint64_t hash)
{
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
    return hash;
}

#define DIGEST_START UINT64_C(14695981039346656037)

static void write_number(unsigned char *bytes, uint64_t number)
{
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(number >> 8 * i & 0xff);
}

static uint64_t read_number(const unsigned char *bytes)
{
    uint64_t number = 0;
    for (int i = 0; i < 8; i++)
        number |= (uint64_t)bytes[i] << 8 * i;
    return number;
}

static uint64_t digest_token(void)
{
    return digest((const unsigned char *)hc_description.token, strlen(hc_description.token), DIGEST_START);
}

#define MAGIC UINT64_C(0x31455441545f4348) /* "HC_STATE1", its first eight letters */

int hc_state_size(hc_component *c, const void *state, size_t *size)
{
    if (hc_no_null(c, size, "size", 1) || check_state(c, state))
        return HC_ERROR;
    *size = HEAD + 8 * ((const state_type *)state)->count;
    return HC_DONE;
}

int hc_state_write(hc_component *c, const void *state, unsigned char *bytes, size_t size)
{
    const state_type *from = state;
    size_t count;
    if (check_state(c, state) || hc_no_null(c, bytes, "serializedState", 1))
        return HC_ERROR;
    count = from->count;
    if (size != HEAD + 8 * count)
        return hc_fail(c, "room for %zu bytes where a state has %zu", size, HEAD + 8 * count);
    for (size_t i = 0; i < count; i++) {
        uint64_t number;
        memcpy(&number, from->value + i, sizeof number);
        write_number(bytes + HEAD + 8 * i, number);
    }
    write_number(bytes, MAGIC);
    write_number(bytes + 8, FORMAT);
    write_number(bytes + 16, digest_token());
    write_number(bytes + 24, count);
    write_number(bytes + 32, digest(bytes + HEAD, 8 * count, DIGEST_START));
    return HC_DONE;
}

int hc_state_read(hc_component *c, const unsigned char *bytes, size_t size, void **state)
{
    const size_t count = HC_DELAYS && size >= HEAD ? (size - HEAD) / 8 : count_state(c);
    const int fresh = state && !*state;
    state_type *made;
    if (hc_no_null(c, bytes, "serializedState", 1) || hc_no_null(c, state, "FMUState", 1))
        return HC_ERROR;
    if (size < HEAD || read_number(bytes) != MAGIC)
        return hc_fail(c, "these %zu bytes are no state of such an FMU", size);
    if (read_number(bytes + 8) != FORMAT)
        return hc_fail(c, "the state has format %lu, this FMU reads format %d",
                       (unsigned long)read_number(bytes + 8), FORMAT);
    if (read_number(bytes + 16) != digest_token())
        return hc_fail(c, "the state is of another FMU: its instantiation token differs");
    if (size != HEAD + 8 * count || read_number(bytes + 24) != count)
        return hc_fail(c, "the state has %zu bytes, one of this kind of instance has %zu", size, HEAD + 8 * count);
    if (read_number(bytes + 32) != digest(bytes + HEAD, 8 * count, DIGEST_START))
        return hc_fail(c, "the state is damaged: its checksum differs");
    made = room_for(c, state, count);
    if (!made)
        return HC_ERROR;
    for (size_t i = 0; i < count; i++) {
        const uint64_t number = read_number(bytes + HEAD + 8 * i);
        memcpy(made->value + i, &number, sizeof number);
    }
    if (check_state(c, made) == HC_DONE)
        return HC_DONE;
    if (fresh)
        hc_state_free(c, state);
    return HC_ERROR;
}
