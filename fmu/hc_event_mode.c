/* Event Mode: stick and slip, switches at given times, ticks, delayed inputs. */
#include "hc_instance_internal.h"

#include <string.h>

#include "hc_friction.h"

#define AT_SWITCH 1e-12          /* relative; an event closer to a switch than this counts as at it */

void hc_log_modes(const hc_instance *c, const int *before, const int *after)
{
    static const char *const words[] = {"slips backwards", "sticks", "slips forwards"};
    for (int k = 0; k < c->model->n_friction; k++)
        if (before[k] != after[k])
            hc_log_message(&c->log, HC_DONE, NULL, "%s %s from time %.17g on",
                        hc_description.names[c->model->friction_state[k]], words[after[k] + 1], c->value[0]);
}

/* Find the next switch at a given time; until it is passed, the model is evaluated only before it. */
static void look_for_switch(hc_instance *c)
{
    const double t = c->value[0];
    double from = t + hc_room(t), next;
    c->earliest = -DBL_MAX;
    c->latest = c->next_switch = DBL_MAX;
    if (!c->model->next_switch)
        return;
    next = c->model->next_switch(from, c->p);
    if (next < DBL_MAX && next - t <= AT_SWITCH * fabs(next)) {
        from = next + hc_room(next);
        next = c->model->next_switch(from, c->p);
    }
    c->earliest = from;
    c->next_switch = next;
    if (next < DBL_MAX)
        c->latest = next - hc_room(next);
}

/* Set velocities at or past zero to zero and find their modes: stick, or slip in either direction. */
static int update_modes(hc_instance *c, int *states_changed)
{
    const hc_model_type *m = c->model;
    int *before = c->mode_before;
    memcpy(before, c->mode, (size_t)m->n_friction * sizeof *before);
    for (int k = 0; k < m->n_friction; k++) {
        double *v = c->x + m->friction_state[k];
        c->z[k] = *v; /* work space here */
        if (before[k] == 0 ? hc_is_at_rest(c, k) : before[k] * *v <= 0.0)
            *v = 0.0;
        else
            c->mode[k] = *v > 0.0 ? 1 : -1;
    }
    if (m->n_friction > 0 &&
        hc_friction_modes(m, hc_instance_time(c), c->x, c->in, c->p, c->mode, c->a, c->b) != HC_OK)
        return hc_fail(c, "the forces are not finite at time %.17g", c->value[0]);
    for (int k = 0; k < m->n_friction; k++) {
        double *v = c->x + m->friction_state[k];
        if (before[k] != 0 && c->mode[k] == -before[k])
            *v = c->z[k]; /* it slips through zero: keep its value */
        *states_changed |= *v != c->z[k];
    }
    hc_log_modes(c, before, c->mode);
    return HC_DONE;
}

/* Execute due ticks, or repeat those of this time with the values set since. */
static int update_ticks(hc_instance *c)
{
    const hc_model_type *m = c->model;
    const double t = c->value[0];
    if (hc_ticks_due(&c->ticks, t))
        hc_ticks_take(&c->ticks, t, c->x, c->in, c->p, c->mode);
    else if (c->ticks.ticked && hc_ticks_same(&c->ticks, c->ticks.at, t))
        hc_ticks_again(&c->ticks, t, c->x, c->in, c->p, c->mode);
    for (int i = m->n_states - m->n_held; i < m->n_states; i++)
        if (!hc_is_finite(c->x[i]))
            return hc_fail_ticks(c);
    return HC_DONE;
}

int hc_update_discrete_states(hc_instance *c, int *states_changed, double *next)
{
    int status = HC_DONE;
    /* Importers restart their integration if states have changed. They must also do so at ticks, switches and input
     * steps, where derivatives jump. */
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
        hc_invalidate(c);
        if (c->changed && c->model->n_ticks > 0 && hc_tell_solver(c) != HC_OK)
            status = hc_fail_ticks(c);
    }
    *next = hc_next_event(c);
    c->updated = HC_UPDATED;
    return status;
}

int hc_leave_event_mode(hc_instance *c, unsigned state)
{
    if (c->updated == HC_AT_START && c->kind == HC_MODEL_EXCHANGE) {
        int changed;
        double next;
        hc_log_message(&c->log, HC_WARNING, c->function,
                       "the discrete states were not updated after initialization, as FMI requires: they are updated "
                       "now, and the importer does not learn the time of the next event");
        if (hc_update_discrete_states(c, &changed, &next) != HC_DONE)
            return HC_ERROR;
    }
    if (c->updated != HC_UPDATED)
        return hc_fail(c, "the discrete states must be updated first");
    if (c->kind == HC_MODEL_EXCHANGE && c->changed) { /* inputs set in this Event Mode */
        look_for_switch(c);
        if (c->model->n_ticks > 0 && update_ticks(c) != HC_DONE)
            return HC_ERROR;
        if (c->model->n_friction > 0)
            hc_friction_modes(c->model, hc_instance_time(c), c->x, c->in, c->p, c->mode, c->a, c->b);
        c->changed = 0;
        c->valid = VALID_STATES | VALID_MODES;
    }
    c->state = state;
    return HC_DONE;
}
