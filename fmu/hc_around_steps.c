/* A corrected FMU for Co-Simulation.
 *
 * Inner FMU for Model Exchange: our solver integrates its equations and those of the Block together and locates its
 * events. Inner FMU for Co-Simulation: it gets its inputs at the beginning of each step and holds them; then the Block's
 * states are integrated, with the inner FMU's outputs on straight lines from the beginning of the step to its end.
 */
#include "hc_around.h"

#include <string.h>

#define MOST_UPDATES 1000
#define MOST_STEPS 10000000L
#define HALVINGS 60
enum { LOOKS = 4 }; /* points of a step at which event indicators are read */

static const hc_around_table *const table = &hc_surroundings;

/* The solver passes its parameters on: the only one is this instance. */
static hc_around *instance_of(const double *p)
{
    hc_around *c;
    memcpy(&c, p, sizeof c);
    return c;
}

static void not_finite(double *dx, int n)
{
    for (int i = 0; i < n; i++)
        dx[i] = NAN;
}

static int move_to(hc_around *c, double t, const double *x)
{
    const int status = hc_around_set_time(c, t);
    return status < HC_DISCARD ? hc_around_set_states(c, x, (size_t)c->joint.n_states) : status;
}

static void joint_derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    hc_around *c = instance_of(p);
    (void)u;
    (void)mode;
    if (c->state == HC_FAILED || move_to(c, t, x) >= HC_DISCARD ||
        hc_around_get_part(c, HC_DERIVATIVES, dx, (size_t)c->joint.n_states) >= HC_DISCARD)
        not_finite(dx, c->joint.n_states);
}

static void own_derivatives(double t, const double *x, const double *u, const double *p, const int *mode, double *dx)
{
    hc_around *c = instance_of(p);
    (void)u;
    (void)mode;
    c->t = t;
    memcpy(c->x, x, (size_t)c->joint.n_states * sizeof *x);
    c->valid = 0;
    if (hc_around_evaluate(c) < HC_DISCARD)
        hc_model.derivatives(t, c->x, c->in, c->p, NULL, dx);
    else
        not_finite(dx, c->joint.n_states);
}

/* ---- events of the inner FMU for Model Exchange ---- */

/* Pass an event: update discrete states until none changes, and read the states. */
static int pass_event(hc_around *c)
{
    const size_t n = (size_t)c->joint.n_states;
    hc_inner_event event = {1, 0, 0, 0, DBL_MAX};
    int status = c->state == HC_EVENT ? HC_DONE : hc_around_enter_event(c);
    for (int k = 0; status < HC_DISCARD && event.again && !event.terminate; k++) {
        if (k >= MOST_UPDATES)
            return hc_around_fail(c, "the event at time %.17g does not end", c->t);
        status = hc_around_update(c, &event);
    }
    c->ended = event.terminate;
    if (status < HC_DISCARD)
        status = hc_around_enter_continuous(c);
    if (status < HC_DISCARD)
        status = hc_around_get_part(c, HC_STATES, c->joint_x, n);
    if (status < HC_DISCARD)
        status = hc_around_get_part(c, HC_INDICATORS, c->z_start, (size_t)table->n_indicators);
    if (status >= HC_DISCARD)
        return hc_around_fail(c, "the FMU inside fails at the event at time %.17g", c->t);
    return hc_solver_set(c->solver, c->t, c->joint_x, NULL, NULL) == HC_OK
               ? HC_DONE
               : hc_around_fail(c, "no derivatives at time %.17g", c->t);
}

/* Whether an event indicator has another sign than at the start of the step: z > 0 or z <= 0 (FMI 2.0, 3.1.1). */
static int crossed(hc_around *c, double t)
{
    hc_solver_inside(c->solver, t, c->joint_x);
    if (move_to(c, t, c->joint_x) >= HC_DISCARD ||
        hc_around_get_part(c, HC_INDICATORS, c->z, (size_t)table->n_indicators) >= HC_DISCARD)
        return -1;
    for (int i = 0; i < table->n_indicators; i++)
        if ((c->z[i] > 0.0) != (c->z_start[i] > 0.0))
            return 1;
    return 0;
}

/* The time of the first event within the last step; its end, with *found 0, if there is none. */
static double first_event(hc_around *c, int *found)
{
    const double start = c->solver->t0, end = c->solver->t;
    double low = start, high = end;
    *found = 0;
    for (int k = 1; k <= LOOKS && !*found && table->n_indicators > 0; k++) {
        high = k == LOOKS ? end : start + (end - start) * k / LOOKS;
        *found = crossed(c, high);
        if (!*found)
            low = high;
    }
    for (int k = 0; k < HALVINGS && *found == 1; k++) {
        const double middle = low + 0.5 * (high - low);
        if (!(middle > low && middle < high))
            break;
        if (crossed(c, middle))
            high = middle;
        else
            low = middle;
    }
    return *found ? high : end;
}

static int exchange_step(hc_around *c, double end)
{
    hc_solver *s = c->solver;
    int found, event = 0, terminate = 0, due = c->changed;
    for (long steps = 0; !c->ended; steps++) {
        const double own = hc_around_next(c), next = own < c->inner_next ? own : c->inner_next;
        if (due || (s->t < end && next <= s->t + hc_room(s->t))) {
            if (pass_event(c) != HC_DONE)
                return HC_ERROR;
            due = 0;
            continue;
        }
        if (s->t >= end)
            break;
        if (steps > MOST_STEPS)
            return hc_around_fail(c, "too many steps at time %.17g", s->t);
        if (hc_solver_step(s, next < end - hc_room(end) ? next : end) != HC_OK || c->state == HC_FAILED)
            return hc_around_fail(c, "the integration stopped at time %.17g", s->t);
        const double at = first_event(c, &found);
        hc_solver_inside(s, at, c->joint_x);
        if (found < 0 || move_to(c, at, c->joint_x) >= HC_DISCARD ||
            hc_around_completed_step(c, &event, &terminate) >= HC_DISCARD)
            return hc_around_fail(c, "the FMU inside fails at time %.17g", at);
        c->ended |= terminate;
        due = found || event;
    }
    return HC_DONE;
}

/* ---- the inner FMU for Co-Simulation ---- */

/* Integrate the Block's states from t to stop along the ramp of the sources. */
static int integrate_own(hc_around *c, double t, double stop)
{
    const int n = c->joint.n_states, n_late = table->n_sources - table->n_early;
    const double *source = c->u + table->n_driven;
    int status = HC_OK;
    if (hc_inner_get(c->inner, table->source + table->n_early, (size_t)n_late, c->y_end + table->n_early) >= HC_DISCARD)
        return hc_around_fail(c, "outputs of the FMU inside cannot be read at time %.17g", stop);
    memcpy(c->y_start, source, (size_t)table->n_sources * sizeof *source);
    c->ramp = 1;
    c->t_start = t;
    c->t_end = stop;
    if (n > 0) {
        memcpy(c->joint_x, c->x, (size_t)n * sizeof *c->x);
        status = hc_solver_set(c->solver, t, c->joint_x, NULL, NULL);
        if (status == HC_OK)
            status = hc_solver_advance(c->solver, stop);
        memcpy(c->x, hc_solver_states(c->solver), (size_t)n * sizeof *c->x);
    }
    c->ramp = c->valid = 0;
    c->t = stop;
    return status == HC_OK ? HC_DONE : hc_around_fail(c, "the integration stopped at time %.17g", c->solver->t);
}

static int slave_steps(hc_around *c, double end)
{
    while (c->t < end && !c->ended) {
        const double t = c->t;
        double stop = end;
        int status = hc_around_tick(c); /* sets the inner FMU's inputs */
        if (status < HC_DISCARD && !hc_history_keep(&c->history, t, c->late))
            return hc_around_fail(c, "no memory");
        c->changed = 0;
        if (table->variable_step && hc_around_next(c) < end - hc_room(end) && hc_around_next(c) > t + hc_room(t))
            stop = hc_around_next(c);
        if (status < HC_DISCARD)
            status = hc_inner_step(c->inner, t, stop - t, &c->ended);
        if (status >= HC_DISCARD)
            return hc_around_passed(c, status);
        if (integrate_own(c, t, stop) != HC_DONE)
            return HC_ERROR;
    }
    return HC_DONE;
}

/* ---- steps ---- */

int hc_around_solver(hc_around *c)
{
    const int moving = (int)hc_around_continuous();
    const int exchange = c->inner_kind == HC_MODEL_EXCHANGE;
    const hc_options options = {HC_DORMAND_PRINCE, c->rtol, c->rtol * (table->atol / table->rtol), 0.0, 0,
                                c->joint_nominal};
    memset(&c->joint, 0, sizeof c->joint);
    c->joint.n_states = moving + (exchange ? table->n_states : 0);
    c->joint.n_parameters = 1;
    c->joint.derivatives = exchange ? joint_derivatives : own_derivatives;
    if (exchange && hc_inner_get_nominals(c->inner, c->joint_nominal, (size_t)table->n_states) >= HC_DISCARD)
        return hc_around_fail(c, "nominal values of the FMU inside cannot be read");
    for (int i = 0; i < moving; i++)
        c->joint_nominal[c->joint.n_states - moving + i] = table->nominal[i];
    hc_solver_free(c->solver);
    c->solver = hc_solver_new(&c->joint, &options);
    if (!c->solver)
        return hc_around_fail(c, "no memory");
    memcpy(c->solver->p, &c, sizeof c);
    return HC_DONE;
}

int hc_around_begin(hc_around *c)
{
    if (hc_around_solver(c) != HC_DONE)
        return HC_ERROR;
    if (c->inner_kind == HC_CO_SIMULATION)
        return HC_DONE;
    c->state = HC_EVENT;
    if (pass_event(c) != HC_DONE)
        return HC_ERROR;
    c->state = HC_STEP;
    return HC_DONE;
}

int hc_around_step(hc_around *c, double time, double length)
{
    const double end = time + length, room = 16.0 * DBL_EPSILON * fabs(end) + 1e-6 * length;
    const int exchange = c->inner_kind == HC_MODEL_EXCHANGE;
    int status;
    if (!hc_is_finite(length) || !(length > 0.0) || !(end > time))
        return hc_around_fail(c, "the step size is %g; it must be positive", length);
    if (!(fabs(time - c->t) <= room))
        return hc_around_fail(c, "the step begins at time %.17g, but the FMU is at time %.17g", time, c->t);
    if (c->stop_time < DBL_MAX && end > c->stop_time + room)
        return hc_around_fail(c, "the step ends at time %.17g, after the stop time %.17g", end, c->stop_time);
    if (c->ended)
        return hc_around_fail(c, "the FMU inside has ended the simulation at time %.17g", c->t);
    c->state = exchange && c->inner_event ? HC_EVENT : exchange ? HC_CONTINUOUS_TIME : HC_STEP;
    c->inner_event = 0;
    status = exchange ? exchange_step(c, end) : slave_steps(c, end);
    if (status != HC_DONE)
        return status;
    c->state = HC_STEP;
    if (c->ended) {
        hc_log_message(&c->log, HC_WARNING, c->function, "the FMU inside ends the simulation at time %.17g", c->t);
        return HC_DISCARD;
    }
    return HC_DONE;
}
