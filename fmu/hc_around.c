/* A corrected FMU is made, started and evaluated; see hc_around.h. */
#include "hc_around.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const hc_around_table *const table = &hc_surroundings;

/* ---- messages and states ---- */

int hc_around_fail(hc_around *c, const char *format, ...)
{
    char text[400];
    va_list values;
    va_start(values, format);
    vsnprintf(text, sizeof text, format, values);
    va_end(values);
    hc_log_message(&c->log, HC_ERROR, c->function, "%s", text);
    c->state = HC_FAILED;
    return HC_ERROR;
}

int hc_around_passed(hc_around *c, int status)
{
    if (status >= HC_ERROR)
        c->state = HC_FAILED;
    return status;
}

int hc_around_enter(hc_around *c, const char *function, unsigned allowed)
{
    if (!c)
        return 0;
    c->function = function;
    if (c->state & allowed)
        return 1;
    hc_around_fail(c, c->state == HC_FAILED ? "not allowed after an error: reset the instance, restore a state, or free it"
                                            : "not allowed in the present state");
    return 0;
}

/* ---- life ---- */

static double *take(double **block, int n)
{
    double *here = *block;
    *block += n;
    return here;
}

static int allocate(hc_around *c, int kind, const char *name)
{
    const hc_model_type *m = &hc_model;
    const int n = m->n_states, all = table->n_states + n;
    const size_t sum = (size_t)(2 * n + m->n_parameters + 2 * m->n_inputs + m->n_outputs + 2 * table->n_late +
                                2 * all + 2 * table->n_indicators + 2 * table->n_sources + 1);
    double *block = calloc(sum + hc_ticks_size(m), sizeof *block);
    c->name = malloc(strlen(name) + 1);
    c->x = block;
    if (!block || !c->name || !hc_history_new(&c->history, table->n_late))
        return 0;
    take(&block, n);
    c->dx = take(&block, n);
    c->p = take(&block, m->n_parameters);
    c->u = take(&block, m->n_inputs);
    c->in = take(&block, m->n_inputs);
    c->y = take(&block, m->n_outputs);
    c->late = take(&block, table->n_late);
    c->shown = take(&block, table->n_late + 1);
    c->joint_x = take(&block, all);
    c->joint_nominal = take(&block, all);
    c->z = take(&block, table->n_indicators);
    c->z_start = take(&block, table->n_indicators);
    c->y_start = take(&block, table->n_sources);
    c->y_end = take(&block, table->n_sources);
    hc_ticks_place(&c->ticks, m, kind == HC_CO_SIMULATION ? HC_TICK_SHARE : 0.0, block);
#if HC_DELAYS
    c->delays = hc_delays_new(m->n_inputs);
    if (!c->delays)
        return 0;
#endif
    memcpy(c->name, name, strlen(name) + 1);
    return 1;
}

hc_around *hc_around_new(const hc_log_type *log, const char *function, int kind, const char *name, const char *token)
{
    hc_around *c;
    if (!name || !*name) {
        hc_log_message(log, HC_ERROR, function, "the instance needs a name");
        return NULL;
    }
    if (!token || strcmp(token, table->token) != 0) {
        hc_log_message(log, HC_ERROR, function,
                       "the instantiation token is \"%.100s\", but that of this binary is \"%.100s\"",
                       token ? token : "NULL", table->token);
        return NULL;
    }
    c = calloc(1, sizeof *c);
    if (!c || !allocate(c, kind, name)) {
        hc_log_message(log, HC_ERROR, function, "no memory");
        hc_around_free(c);
        return NULL;
    }
    c->log = *log;
    c->log.instance = c->name;
    c->function = function;
    c->kind = kind;
    c->inner_kind = kind == HC_CO_SIMULATION && table->inner_exchange ? HC_MODEL_EXCHANGE : kind;
    return c;
}

void hc_around_free(hc_around *c)
{
    if (!c)
        return;
    hc_solver_free(c->solver);
#if HC_DELAYS
    hc_delays_free(c->delays);
#endif
    hc_history_free(&c->history);
    free(c->space);
    free(c->x);
    free(c->name);
    free(c);
}

int hc_around_start(hc_around *c)
{
    const hc_model_type *m = &hc_model;
    const double *start = table->start;
    c->state = HC_INSTANTIATED;
    c->t = c->start_time = 0.0;
    c->stop_time = c->inner_next = c->latest = c->next_switch = DBL_MAX;
    c->earliest = -DBL_MAX;
    c->rtol = table->rtol;
    c->valid = c->ended = c->ramp = c->inner_event = 0;
    c->changed = 1;
    for (int i = 0; i < m->n_states; i++)
        c->x[i] = *start++;
    for (int i = 0; i < table->n_driven; i++)
        c->u[i] = *start++;
    for (int i = 0; i < m->n_parameters; i++)
        c->p[i] = *start++;
    hc_history_clear(&c->history);
    return hc_around_passed(c, hc_inner_set(c->inner, table->set, (size_t)table->n_set, table->set_value));
}

int hc_around_experiment(hc_around *c, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    if (!hc_is_finite(start))
        return hc_around_fail(c, "the start time is %g; it must be a number", start);
    c->t = c->start_time = start;
    c->stop_time = has_stop && hc_is_finite(stop) ? stop : DBL_MAX;
    if (has_tolerance && tolerance > 0.0 && hc_is_finite(tolerance))
        c->rtol = tolerance;
    c->valid = 0;
    return HC_DONE;
}

/* ---- evaluation ---- */

static int outputs(hc_around *c)
{
    if (hc_model.n_outputs > 0)
        hc_model.outputs(hc_around_time(c), c->x, c->in, c->p, NULL, c->y);
    return HC_DONE;
}

int hc_around_evaluate(hc_around *c)
{
    const int early = table->n_early, others = table->n_sources - early;
    double *source = c->u + table->n_driven;
    int status = HC_DONE;
    if (c->valid)
        return HC_DONE;
    if (c->ramp) { /* within a step of an inner FMU for Co-Simulation */
        const double part = c->t_end > c->t_start ? (c->t - c->t_start) / (c->t_end - c->t_start) : 0.0;
        for (int i = early; i < table->n_sources; i++)
            source[i] = c->y_start[i] + part * (c->y_end[i] - c->y_start[i]);
    } else {
        status = hc_inner_get(c->inner, table->source, (size_t)early, source);
        if (status >= HC_DISCARD)
            return hc_around_passed(c, status);
    }
    memcpy(c->in + table->n_driven, source, (size_t)table->n_sources * sizeof *source);
#if HC_DELAYS
    if (c->state & (HC_INSTANTIATED | HC_INITIALIZATION))
        hc_delays_rest(c->delays, c->u, table->start + hc_model.n_states, c->p);
    memcpy(c->in, hc_delays_inputs(c->delays), (size_t)table->n_driven * sizeof *c->in);
#else
    memcpy(c->in, c->u, (size_t)table->n_driven * sizeof *c->in);
#endif
    if (!c->ramp) {
        outputs(c); /* the inner FMU's inputs do not depend on the other sources */
        status = hc_inner_set(c->inner, table->driven, (size_t)table->n_driven, c->y);
        if (status < HC_DISCARD)
            status = hc_inner_get(c->inner, table->source + early, (size_t)others, source + early);
        if (status >= HC_DISCARD)
            return hc_around_passed(c, status);
    }
    for (int i = early; i < table->n_sources; i++)
        c->in[table->n_driven + i] = source[i];
    for (int k = 0; k < table->n_late; k++) {
        const int i = table->late_source[k];
        c->late[k] = source[i];
        c->in[table->n_driven + i] = hc_history_late(&c->history, k, c->t, source[i]);
    }
    outputs(c);
    c->valid = 1;
    return status;
}

/* ---- initialization ---- */

static int begin_late(hc_around *c)
{
    if (table->n_late > 0) {
        table->late_seconds(c->p, c->history.delay);
        memcpy(c->history.before, table->late_start, (size_t)table->n_late * sizeof *c->late);
        for (int k = 0; k < table->n_late; k++)
            if (!(c->history.delay[k] >= 0.0 && c->history.delay[k] <= DBL_MAX))
                return hc_around_fail(c, "a delay is negative or not finite");
    }
#if HC_DELAYS
    if (hc_delays_rest(c->delays, c->u, table->start + hc_model.n_states, c->p) >= 0)
        return hc_around_fail(c, "a delay is negative or not finite");
    if (!hc_delays_send(c->delays, c->t, c->u))
        return hc_around_fail(c, "no memory");
    hc_delays_arrive(c->delays, c->t);
#endif
    return HC_DONE;
}

int hc_around_before_exit(hc_around *c)
{
    if (begin_late(c) != HC_DONE)
        return HC_ERROR;
    c->valid = 0;
    return hc_around_evaluate(c);
}

int hc_around_after_exit(hc_around *c)
{
    hc_ticks_start(&c->ticks, c->t);
    c->valid = 0;
    c->changed = 1;
    if (c->kind == HC_MODEL_EXCHANGE) {
        c->state = HC_EVENT;
        return HC_DONE;
    }
    c->state = HC_STEP;
    return hc_around_begin(c);
}
