/* Co-Simulation: the FMU's own solver integrates from one communication point to the next. */
#include "hc_instance_internal.h"

#define AHEAD 100.0              /* communication steps that a solver step may span: forces at rest are sampled */
#define MAX_STEPS 10000000L      /* solver steps in one communication step; takes seconds */
#define LOOKS 50                 /* Euler steps to find the state that is hardest to integrate */

static int check_step(hc_instance *c, double time, double length)
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

/* Index of a state whose derivative is not finite at the solver's time. If there is none, the state that changes
 * most, relative to its tolerance, in LOOKS short Euler steps. */
static int hardest_state(hc_solver *s)
{
    const double h = s->h > 0.0 ? 10.0 * s->h : 1e-6;
    double *x = s->stage, *before = s->k[0], *now = s->k[1], *most = s->k[2], *kept;
    int found = 0;
    for (int i = 0; i < s->n; i++) {
        x[i] = s->x[i];
        most[i] = 0.0;
    }
    hc_ticks_hold(s->model, x, s->x);
    for (int step = 0; step < LOOKS; step++) {
        hc_right_hand_side(s, s->t + step * h, x, now);
        for (int i = 0; i < s->n; i++) {
            if (!hc_is_finite(now[i]))
                return i;
            if (step > 0 && fabs(now[i] - before[i]) > most[i])
                most[i] = fabs(now[i] - before[i]);
            x[i] += h * now[i];
        }
        kept = before;
        before = now;
        now = kept;
    }
    for (int i = 0; i < s->n; i++) {
        most[i] /= s->absolute[i] + s->rtol * fabs(s->x[i]);
        if (most[i] > most[found])
            found = i;
    }
    return found;
}

static int fail_step(hc_instance *c, int status)
{
    const int i = hardest_state(c->solver);
    const char *reason = status == HC_NOT_FINITE       ? "a derivative or a force is not finite"
                         : status == HC_STEP_TOO_SMALL ? "the tolerance cannot be met"
                                                       : "too many steps";
    c->value[0] = hc_solver_time(c->solver);
    c->valid = 0;
    hc_read_states(c);
    if (c->solver->n == 0)
        return hc_fail(c, "the integration stopped at time %.17g: %s", c->value[0], reason);
    return hc_fail(c, "the integration stopped at time %.17g: %s; the state %.150s = %.9g is the hardest to integrate",
                   c->value[0], reason, hc_description.names[i], c->x[i]);
}

/* Go past the event that ended the solver's last step. */
static void pass_event(hc_instance *c)
{
    const hc_solver *s = c->solver;
    c->event = 0;
    c->value[0] = s->t;
    hc_log_modes(c, s->mode0, s->mode);
    if (s->t >= s->next_switch)
        hc_log_message(&c->log, HC_DONE, NULL, "a condition on time changes at time %.17g", s->t);
}

#if HC_DELAYS
/* Apply delayed inputs that are due and pass them to the solver. */
static int pass_arrivals(hc_instance *c)
{
    if (!hc_delays_arrive(c->delays, c->solver->t))
        return HC_OK;
    c->event = 1;
    return hc_solver_set(c->solver, c->solver->t, NULL, c->in, NULL);
}

/* `stop`, or the arrival time of the next delayed input if that is earlier. */
static double stop_at_arrival(const hc_instance *c, double stop, double end)
{
    const double next = hc_delays_next(c->delays);
    if (fabs(next - end) <= hc_room(end))
        return end;
    return next < stop ? next : stop;
}
#endif

/* The importer reads the instance at the solver's time; 1 if it wants the step to end there. */
static int intermediate_update(hc_instance *c, int before_end)
{
    const char *function = c->function;
    int early;
    c->value[0] = c->solver->t;
    c->valid = 0;
    c->state = HC_INTERMEDIATE;
    early = c->update(c, before_end && c->early_return_allowed);
    if (c->state == HC_FAILED)
        return 0;
    c->state = HC_STEP;
    c->function = function;
    c->valid = 0;
    return early;
}

int hc_do_step(hc_instance *c, double time, double length, int *event, int *early)
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
    if (!(c->changed && c->changed_before) && !c->intermediate) { /* inputs are constant: the solver may pass the end of the step */
        stop = end + AHEAD * length < c->stop_time ? end + AHEAD * length : c->stop_time;
        stop = stop > end ? stop : end;
    }
    c->changed_before = c->changed;
    if (c->changed) {
        hc_read_states(c);
        status = hc_tell_solver(c);
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
                if (s->t >= s->next_switch) /* do not pass a switch before the discrete states are updated */
                    c->latest = s->t - hc_room(s->t);
                c->valid = 0;
                return HC_DONE;
            }
        }
        if (s->t >= end)
            break;
        if (steps > MAX_STEPS)
            return fail_step(c, HC_TOO_MANY_STEPS);
        const long events = s->counts[HC_EVENTS];
        if (hc_ticks_same(&s->ticks, s->ticks.next, end) || hc_ticks_same(&s->ticks, s->ticks.at, end))
            stop = end; /* ticks at the end must use inputs that are set there */
#if HC_DELAYS
        status = hc_solver_step(s, stop_at_arrival(c, stop, end));
#else
        status = hc_solver_step(s, stop);
#endif
        c->event = s->counts[HC_EVENTS] != events || s->t >= s->next_switch;
        if (status != HC_OK && s->t > end) { /* the failure lies past the end: restart there at the next step */
            c->value[0] = end;
            c->valid = 0;
            hc_read_states(c);
            c->changed = c->changed_before = 1;
            c->event = 0;
        } else if (status != HC_OK && stop > end) {
            stop = end;
            hc_solver_restart(s);
        } else if (status != HC_OK) {
            return fail_step(c, status);
        } else if (c->intermediate && s->t <= end) {
            *early = intermediate_update(c, s->t < end);
            if (c->state == HC_FAILED)
                return HC_ERROR;
            if (*early)
                return HC_DONE;
        }
    }
    c->value[0] = end;
    if (!c->changed)
        c->valid = 0;
    return HC_DONE;
}
