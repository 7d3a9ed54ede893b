/* Model Exchange: the importer integrates. */
#include "hc_instance_internal.h"

#include <string.h>

#define UNREPORTED 1000 /* more states than the stages of any step and its repetitions */

int hc_set_time(hc_instance *c, double time)
{
    if (!hc_is_finite(time))
        return hc_fail(c, "time is set to %s", time != time ? "NaN" : "an infinite value");
    if (time != c->value[0]) {
        c->value[0] = time;
        hc_invalidate(c);
    }
    return HC_DONE;
}

static int check_length(hc_instance *c, const void *values, size_t n, size_t expected, const char *what)
{
    if (n != expected)
        return hc_fail(c, "%zu values where there are %zu %s", n, expected, what);
    return hc_no_null(c, values, what, n);
}

int hc_set_states(hc_instance *c, const double *x, size_t n)
{
    if (check_length(c, x, n, hc_n_continuous(c), "continuous states"))
        return HC_ERROR;
    for (size_t i = 0; i < n; i++)
        if (!hc_is_finite(x[i]))
            return hc_discard(c, "state %s is set to a value that is not finite", hc_description.names[i]);
    memcpy(c->x, x, n * sizeof *x);
    hc_invalidate(c);
    if (++c->states_set == UNREPORTED && c->state == HC_CONTINUOUS_TIME &&
        (c->model->n_friction > 0 || hc_next_event(c) < DBL_MAX))
        hc_log_message(&c->log, HC_WARNING, c->function,
                       "%d states set without completedIntegratorStep: an importer that passes no events keeps the modes "
                       "of dry friction, and what ticks, as they were", UNREPORTED);
    return HC_DONE;
}

int hc_get_part(hc_instance *c, int part, double *into, size_t n)
{
    static const char *const words[] = {"", "continuous states", "derivatives", "", "", "", "event indicators"};
    const unsigned first = c->first[part];
    int status = HC_DONE;
    const size_t held = part == HC_STATES || part == HC_DERIVATIVES ? (size_t)c->model->n_held : 0;
    if (check_length(c, into, n, c->first[part + 1] - first - held, words[part]))
        return HC_ERROR;
    hc_evaluate(c, part);
    for (unsigned i = 0; i < n && status == HC_DONE; i++)
        status = hc_check_finite(c, first + i);
    if (n > 0)
        memcpy(into, c->value + first, n * sizeof *into);
    return status;
}

int hc_get_nominals(hc_instance *c, double *into, size_t n)
{
    if (check_length(c, into, n, hc_n_continuous(c), "continuous states"))
        return HC_ERROR;
    if (n > 0)
        memcpy(into, hc_description.nominal, n * sizeof *into);
    return HC_DONE;
}

double hc_next_event(const hc_instance *c)
{
    double next = c->ticks.next < c->next_switch ? c->ticks.next : c->next_switch;
#if HC_DELAYS
    if (hc_delays_next(c->delays) < next)
        next = hc_delays_next(c->delays);
#endif
    return next;
}

/* Event Mode is asked for wherever it is due, for importers that do not look at indicators and time events, or not
 * where an input jumps. */
int hc_completed_step(hc_instance *c, int *enter_event_mode)
{
    c->states_set = 0;
    *enter_event_mode = c->value[0] >= hc_next_event(c);
    hc_evaluate(c, HC_INDICATORS);
    for (int k = 0; k < c->model->n_friction; k++)
        if (c->z[k] < 0.0 || (c->mode[k] == 0 && !hc_is_at_rest(c, k))) /* sticking, the importer moved it */
            *enter_event_mode = 1;
#if HC_DELAYS
    if (hc_delays_send_prompt(c->delays, c->u))
        *enter_event_mode = 1;
#endif
    return HC_DONE;
}

int hc_enter_event_mode(hc_instance *c)
{
    if (c->kind == HC_CO_SIMULATION && !c->event_mode_used)
        return hc_fail(c, "the instance was made with eventModeUsed = false");
    hc_read_states(c);
    c->state = HC_EVENT;
    c->updated = HC_NOT_UPDATED;
    return HC_DONE;
}
