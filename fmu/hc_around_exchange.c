/* A corrected FMU for Model Exchange: states and events of the inner FMU, then those of the Block. */
#include "hc_around.h"

#include <string.h>

#define AT_SWITCH 1e-12 /* relative; an event closer to a switch than this is at it */

static const hc_around_table *const table = &hc_surroundings;

static int wrong_count(hc_around *c, size_t n, size_t expected, const char *what)
{
    if (n == expected)
        return HC_DONE;
    return hc_around_fail(c, "%zu values where there are %zu %s", n, expected, what);
}

static size_t all_states(void)
{
    return (size_t)table->n_states + hc_around_continuous();
}

int hc_around_set_time(hc_around *c, double time)
{
    if (!hc_is_finite(time))
        return hc_around_fail(c, "time is set to a value that is not finite");
    c->t = time;
    c->valid = 0;
    return hc_around_passed(c, hc_inner_set_time(c->inner, time));
}

int hc_around_set_states(hc_around *c, const double *x, size_t n)
{
    const size_t inner = (size_t)table->n_states;
    if (wrong_count(c, n, all_states(), "continuous states"))
        return HC_ERROR;
    for (size_t i = inner; i < n; i++)
        if (!hc_is_finite(x[i]))
            return HC_DISCARD;
    memcpy(c->x, x + inner, hc_around_continuous() * sizeof *x);
    c->valid = 0;
    return hc_around_passed(c, hc_inner_set_states(c->inner, x, inner));
}

static int get_states(hc_around *c, double *x, size_t n)
{
    const size_t inner = (size_t)table->n_states;
    if (wrong_count(c, n, all_states(), "continuous states"))
        return HC_ERROR;
    memcpy(x + inner, c->x, hc_around_continuous() * sizeof *x);
    return hc_around_passed(c, hc_inner_get_states(c->inner, x, inner));
}

static int derivatives(hc_around *c, double *dx, size_t n)
{
    const size_t inner = (size_t)table->n_states, own = hc_around_continuous();
    const double *added = c->y + table->n_driven + table->n_measured;
    const double t = hc_around_time(c);
    int status;
    if (wrong_count(c, n, all_states(), "derivatives"))
        return HC_ERROR;
    status = hc_around_evaluate(c);
    if (status < HC_DISCARD)
        status = hc_inner_get_derivatives(c->inner, dx, inner);
    if (status >= HC_DISCARD)
        return hc_around_passed(c, status);
    for (int k = 0; k < table->n_added; k++)
        dx[table->added_state[k]] += added[k];
    if (own > 0)
        hc_model.derivatives(t, c->x, c->in, c->p, NULL, c->dx);
    memcpy(dx + inner, c->dx, own * sizeof *dx);
    for (size_t i = 0; i < n; i++)
        if (!hc_is_finite(dx[i]))
            return HC_DISCARD; /* an integrator can try a shorter step */
    return status;
}

static int indicators(hc_around *c, double *z, size_t n)
{
    int status;
    if (wrong_count(c, n, (size_t)table->n_indicators, "event indicators"))
        return HC_ERROR;
    status = hc_around_evaluate(c);
    if (status < HC_DISCARD)
        status = hc_inner_get_indicators(c->inner, z, n);
    return hc_around_passed(c, status);
}

int hc_around_get_part(hc_around *c, int part, double *into, size_t n)
{
    return part == HC_STATES        ? get_states(c, into, n)
           : part == HC_DERIVATIVES ? derivatives(c, into, n)
                                    : indicators(c, into, n);
}

int hc_around_get_nominals(hc_around *c, double *x, size_t n)
{
    const size_t inner = (size_t)table->n_states;
    if (wrong_count(c, n, all_states(), "continuous states"))
        return HC_ERROR;
    if (hc_around_continuous() > 0)
        memcpy(x + inner, table->nominal, hc_around_continuous() * sizeof *x);
    return hc_around_passed(c, hc_inner_get_nominals(c->inner, x, inner));
}

int hc_around_completed_step(hc_around *c, int *event, int *terminate)
{
    int status = hc_around_evaluate(c);
    if (status < HC_DISCARD && !hc_history_keep(&c->history, c->t, c->late))
        return hc_around_fail(c, "no memory");
    if (status < HC_DISCARD)
        status = hc_inner_completed_step(c->inner, event, terminate);
    if (c->kind == HC_MODEL_EXCHANGE && c->t >= hc_around_next(c))
        *event = 1;
#if HC_DELAYS
    if (hc_delays_send_prompt(c->delays, c->u))
        *event = 1;
#endif
    return hc_around_passed(c, status);
}

/* ---- events ---- */

/* Find the next switch; until it is passed, the Block is evaluated only before it. */
static void look_for_switch(hc_around *c)
{
    double from = c->t + hc_room(c->t), next;
    c->earliest = -DBL_MAX;
    c->latest = c->next_switch = DBL_MAX;
    if (!hc_model.next_switch)
        return;
    next = hc_model.next_switch(from, c->p);
    if (next < DBL_MAX && next - c->t <= AT_SWITCH * fabs(next)) {
        from = next + hc_room(next);
        next = hc_model.next_switch(from, c->p);
    }
    c->earliest = from;
    c->next_switch = next;
    if (next < DBL_MAX)
        c->latest = next - hc_room(next);
}

double hc_around_next(const hc_around *c)
{
    double next = c->ticks.next < c->next_switch ? c->ticks.next : c->next_switch;
#if HC_DELAYS
    if (hc_delays_next(c->delays) < next)
        next = hc_delays_next(c->delays);
#endif
    return next;
}

int hc_around_tick(hc_around *c)
{
    int status;
#if HC_DELAYS
    if (!hc_delays_send(c->delays, c->t, c->u))
        return hc_around_fail(c, "no memory");
    hc_delays_arrive(c->delays, c->t);
#endif
    look_for_switch(c);
    c->valid = 0;
    status = hc_around_evaluate(c);
    if (status >= HC_DISCARD || hc_model.n_ticks == 0)
        return status;
    if (hc_ticks_due(&c->ticks, c->t))
        hc_ticks_take(&c->ticks, c->t, c->x, c->in, c->p, NULL);
    else if (c->ticks.ticked && hc_ticks_same(&c->ticks, c->ticks.at, c->t))
        hc_ticks_again(&c->ticks, c->t, c->x, c->in, c->p, NULL);
    c->valid = 0;
    for (int i = hc_model.n_states - hc_model.n_held; i < hc_model.n_states; i++)
        if (!hc_is_finite(c->x[i]))
            return hc_around_fail(c, "a value that ticks set is not finite at time %.17g", c->t);
    return hc_around_evaluate(c);
}

int hc_around_enter_event(hc_around *c)
{
    int status = hc_around_evaluate(c);
    if (status < HC_DISCARD && !hc_history_keep(&c->history, c->t, c->late))
        return hc_around_fail(c, "no memory");
    if (status < HC_DISCARD)
        status = hc_inner_enter_event(c->inner);
    if (status < HC_DISCARD)
        c->state = HC_EVENT;
    return hc_around_passed(c, status);
}

int hc_around_update(hc_around *c, hc_inner_event *event)
{
    const int jumps = c->changed || hc_around_next(c) <= c->t + hc_room(c->t);
    int status = hc_around_tick(c);
    if (status < HC_DISCARD)
        status = hc_inner_update(c->inner, event);
    if (status >= HC_DISCARD)
        return hc_around_passed(c, status);
    c->changed = c->valid = 0;
    c->inner_next = event->next;
    if (hc_around_next(c) < event->next)
        event->next = hc_around_next(c);
    event->states_changed |= jumps; /* importers restart their integration if states have changed */
    return status;
}

int hc_around_enter_continuous(hc_around *c)
{
    int status = hc_around_evaluate(c);
    if (status < HC_DISCARD && !hc_history_keep(&c->history, c->t, c->late))
        return hc_around_fail(c, "no memory");
    if (status < HC_DISCARD)
        status = hc_inner_enter_continuous(c->inner);
    if (status < HC_DISCARD)
        c->state = HC_CONTINUOUS_TIME;
    return hc_around_passed(c, status);
}
