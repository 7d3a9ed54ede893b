/* An instance is created, initialized, reset and freed; its inputs are passed on. See hc_instance.h. */
#include "hc_instance_internal.h"

#include <stdlib.h>
#include <string.h>

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

static hc_instance *allocate(const hc_log_type *log, int kind, const char *name)
{
    const hc_model_type *m = &hc_model;
    const int n = m->n_states, k = m->n_friction, known = n + m->n_inputs + m->n_parameters;
    const int sizes[] = {1, n, n, m->n_inputs, m->n_parameters, m->n_outputs, k, k};
    const size_t real = (size_t)(1 + 2 * n + m->n_inputs + m->n_parameters + m->n_outputs + k);
    const size_t work = (size_t)(2 * k + m->n_partials + known + n + m->n_outputs);
    hc_instance *c = calloc(1, sizeof *c);
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
    hc_ticks_place(&c->ticks, m, 0.0, block);
    c->mode = calloc(2 * (size_t)k + 1, sizeof *c->mode);
    c->told = calloc((size_t)known + 1, 1);
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
        hc_instance_free(c);
        return NULL;
    }
    c->in = hc_delays_inputs(c->delays);
#endif
    c->initial = calloc(c->solver || kind == HC_MODEL_EXCHANGE ? hc_count_state(c) : 1, sizeof *c->initial);
    if (!c->mode || !c->told || !c->name || !c->initial || (kind == HC_CO_SIMULATION && !c->solver)) {
        hc_instance_free(c);
        return NULL;
    }
    c->mode_before = c->mode + k;
    memcpy(c->name, name, strlen(name) + 1);
    c->log = *log;
    c->log.instance = c->name;
    return c;
}

hc_instance *hc_instance_new(const hc_log_type *log, const char *function, int kind, const char *name,
                               const char *token)
{
    const hc_model_type *m = &hc_model;
    hc_instance *c;
    if (!name || is_blank(name)) {
        hc_log_message(log, HC_ERROR, function, "the instance needs a name");
        return NULL;
    }
    if (!token || strcmp(token, hc_description.token) != 0) {
        hc_log_message(log, HC_ERROR, function,
                    "the instantiation token is \"%.100s\", but that of this binary is \"%.100s\"",
                    token ? token : "NULL", hc_description.token);
        return NULL;
    }
    c = allocate(log, kind, name);
    if (!c) {
        hc_log_message(log, HC_ERROR, function, "no memory");
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
    hc_take_inputs(c);
    hc_transfer(c, c->initial, 0);
    return c;
}

void hc_instance_free(hc_instance *c)
{
    if (!c)
        return;
    hc_solver_free(c->solver);
#if HC_DELAYS
    hc_delays_free(c->delays);
#endif
    free(c->initial);
    free(c->expanded);
    free(c->told);
    free(c->name);
    free(c->mode);
    free(c->value);
    free(c);
}

int hc_reset(hc_instance *c)
{
    hc_transfer(c, c->initial, 1);
    return HC_DONE;
}

int hc_set_experiment(hc_instance *c, int has_tolerance, double tolerance, double start, int has_stop, double stop)
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

/* ---- inputs, and what is passed to the solver ---- */

int hc_fail_ticks(hc_instance *c)
{
    return hc_fail(c, "what ticks at time %.17g set is not finite", c->value[0]);
}

/* Pass the values that were set to the solver; execute the ticks of this time, or repeat them. */
int hc_tell_solver(hc_instance *c)
{
    hc_solver *s = c->solver;
    const int ticks = c->model->n_ticks > 0 && s->started, goes_on = ticks && s->t == c->value[0];
    int status;
    if (ticks && !goes_on && s->ticks.ticked && hc_ticks_same(&s->ticks, s->ticks.at, c->value[0]))
        memcpy(c->x + hc_n_continuous(c), s->ticks.before, (size_t)c->model->n_held * sizeof *c->x);
    status = hc_solver_set(s, c->value[0], goes_on ? NULL : c->x, c->in, c->p);
    c->changed = c->event = 0;
    if (c->model->n_ticks > 0) {
        c->valid = 0;
        hc_read_states(c);
    }
    return status;
}

#if HC_DELAYS
/* Until initialization ends, delayed inputs have their start values; the values set then are sent. */
static int begin_delays(hc_instance *c)
{
    const double *start = hc_description.start + c->model->n_states;
    const int wrong = hc_delays_rest(c->delays, c->u, start, c->p);
    if (wrong >= 0)
        return hc_fail(c, "the delay of input %s is negative or not finite",
                       hc_description.names[c->model->n_states + hc_late.input[wrong]]);
    return hc_delays_send(c->delays, c->value[0], c->u) ? HC_DONE : hc_fail(c, "no memory");
}

/* Delays are fixed after initialization. */
int hc_refuse_late(hc_instance *c, int kind, unsigned vr, double value)
{
    char text[200];
    if (kind == PARAMETER && value != c->value[vr] && !(c->state & (HC_INSTANTIATED | HC_INITIALIZATION)) &&
        hc_delays_fixed((int)(vr - c->first[kind])))
        return hc_fail(c, "%s says how late an input acts: it is fixed at initialization", hc_called(c, vr, text));
    return HC_DONE;
}
#endif

/* Compute the model's inputs from those that were set. In Continuous-Time Mode an importer may evaluate times out of
 * order, so delayed inputs, which are discrete, change at events only. */
int hc_take_inputs(hc_instance *c)
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

int hc_exit_initialization(hc_instance *c)
{
#if HC_DELAYS
    if (begin_delays(c) != HC_DONE)
        return HC_ERROR;
#endif
    if (hc_find_modes(c) != HC_OK)
        return hc_fail(c, "the forces at the start are not finite");
    c->updated = HC_AT_START;
    c->changed = 1;
    hc_ticks_start(&c->ticks, c->value[0]);
    if (c->model->n_ticks > 0 && c->solver && hc_tell_solver(c) != HC_OK)
        return hc_fail_ticks(c);
    if (c->kind == HC_MODEL_EXCHANGE || c->event_mode_used)
        c->state = HC_EVENT;
    else
        c->state = HC_STEP;
    return HC_DONE;
}
