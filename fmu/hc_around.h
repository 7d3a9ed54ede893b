/* Private to the runtime: a corrected FMU, that is an FMU with a Block around it. With v the importer's inputs, u the
 * inner FMU's inputs, x and xb the states of the inner FMU and of the Block, and y what the Block reads of the inner FMU:
 *     u = before(t, xb, v),   x' = f(t, x, u) + added(t, xb, y),   xb' = fb(t, xb, v, y),   outputs = after(t, xb, y)
 * `hc_model` is the Block: inputs v then y, outputs u, after, added. Calls that concern other variables go to the inner
 * FMU, which has the same version of FMI and the same value references.
 *
 * Value references of the Block's own variables begin at `first`: states, derivatives of its continuous states,
 * parameters.
 */
#ifndef HC_AROUND_H
#define HC_AROUND_H

#include "hc_delays.h"
#include "hc_history.h"
#include "hc_inner.h"
#include "hc_instance_internal.h"

/* Generated with the FMU; an array that would be empty may be NULL. */
typedef struct {
    const char *identifier, *token; /* of the outer FMU */
    const char *inner_identifier, *inner_token;
    int n_driven, n_early, n_sources, n_measured, n_added;
    const unsigned *driven;   /* the inner FMU's inputs that the Block sets */
    const unsigned *source;   /* what the Block reads; the first n_early do not depend on what it sets */
    const unsigned *measured; /* the outer FMU's outputs that the Block computes */
    const int *added_state;   /* places in the inner FMU's states, and value references of the derivatives */
    const unsigned *added;
    unsigned first;
    int n_states, n_indicators;       /* of the inner FMU for Model Exchange */
    const double *start;              /* of the Block: states, driven inputs, parameters */
    const double *lower, *upper;      /* of its parameters */
    const double *nominal;            /* of its continuous states */
    const char *fixed;                /* its parameters that say how late something acts: 1 */
    const char *const *names;         /* of its parameters */
    int n_set;                        /* start values of the inner FMU that differ from its own */
    const unsigned *set;
    const double *set_value;
    int n_arrays;                     /* the inner FMU's Float64 arrays and their numbers of elements */
    const unsigned *array;
    const unsigned *array_size;
    int inner_exchange, variable_step; /* the inner FMU has Model Exchange; its steps may have any length */
    int differentiable;               /* there are partial derivatives */
    const char *source_known;         /* 1: the inner FMU's known, such as a state or an input, or constant between events */
    int n_late;                       /* sources that arrive late, and by how much [s] */
    const int *late_source;
    void (*late_seconds)(const double *p, double *delay);
    const double *late_start;
    double rtol, atol;
} hc_around_table;

extern const hc_around_table hc_surroundings;

typedef struct hc_around {
    hc_log_type log;
    const char *function;
    char *name;
    int kind, inner_kind;
    unsigned state; /* one bit of hc_instance.h */
    struct hc_inner *inner;

    double t, start_time, stop_time, rtol;
    double earliest, latest, next_switch; /* the Block is evaluated only between two switches */
    double *x, *dx, *p, *u, *in, *y;      /* of the Block; `in` as its equations see u */
    double *late, *shown;                 /* the late sources as read; work space for values */
    int valid;   /* y and the inner FMU's inputs fit t, x, u, p */
    int changed; /* values were set since the last event */
    int inner_event; /* between steps: the inner FMU is in Event Mode, so that anything can be set */
    double inner_next;
    hc_delays *delays;
    hc_history history;
    hc_ticks ticks;

    hc_model_type joint; /* Co-Simulation: the equations that our solver integrates */
    hc_solver *solver;
    double *joint_x, *joint_nominal, *z, *z_start, *y_start, *y_end;
    int ramp;            /* sources go from y_start at t_start to y_end at t_end */
    double t_start, t_end;
    int ended;
    void *space; /* of hc_around_partials.c, and its size */
    size_t room;
} hc_around;

/* ---- hc_around.c: life, messages, evaluation ---- */

hc_around *hc_around_new(const hc_log_type *log, const char *function, int kind, const char *name, const char *token);
void hc_around_free(hc_around *c);
/* Called first by every function: 0, with a message, if the call is not allowed in the current state. */
int hc_around_enter(hc_around *c, const char *function, unsigned allowed);
static inline int hc_around_enter_kind(hc_around *c, const char *function, unsigned allowed, int kind)
{
    (void)kind; /* the states say it */
    return hc_around_enter(c, function, allowed);
}
int hc_around_fail(hc_around *c, const char *format, ...) HC_FORMAT(2, 3);
static inline int hc_around_not_supported(hc_around *c, const char *what)
{
    return hc_around_fail(c, "not supported: %s", what);
}
/* The status of a call to the inner FMU; a failed one ends this instance. */
int hc_around_passed(hc_around *c, int status);
/* Start values, as the inner FMU was made or reset. */
int hc_around_start(hc_around *c);
int hc_around_experiment(hc_around *c, int has_tolerance, double tolerance, double start, int has_stop, double stop);
/* Compute the Block, and set the inner FMU's inputs. */
int hc_around_evaluate(hc_around *c);
/* Before and after the inner FMU leaves Initialization Mode. */
int hc_around_before_exit(hc_around *c);
int hc_around_after_exit(hc_around *c);
static inline size_t hc_around_continuous(void)
{
    return (size_t)(hc_model.n_states - hc_model.n_held);
}

/* Time for the Block, kept between two switches. */
static inline double hc_around_time(const hc_around *c)
{
    return c->t < c->earliest ? c->earliest : c->t > c->latest ? c->latest : c->t;
}

/* ---- hc_around_values.c: real variables ---- */

enum { INNER, GIVEN, MEASURED, ADDED, OWN_STATE, OWN_SLOPE, OWN_PARAMETER };

/* What a value reference is, and its place there. */
int hc_around_kind(unsigned vr, int *place);
/* Place in a list; -1 if it is not there. */
int hc_around_find(const unsigned *list, int n, unsigned vr);
int hc_around_get(hc_around *c, const unsigned *vr, size_t n, double *value);
int hc_around_set(hc_around *c, const unsigned *vr, size_t n, const double *value);
/* Before any variable of the inner FMU is set. */
int hc_around_before_set(hc_around *c);
/* Numbers of values of n variables. */
size_t hc_around_width(const unsigned *vr, size_t n);

/* ---- hc_around_partials.c ---- */

/* Products with the matrix J of partial derivatives: J seed or, where `adjoint`, J' seed. */
int hc_around_partials(hc_around *c, int adjoint, const unsigned *unknown, size_t n_unknown, const unsigned *known,
                       size_t n_known, const double *seed, double *sensitivity);

/* ---- hc_around_exchange.c: Model Exchange ---- */

int hc_around_set_time(hc_around *c, double time);
int hc_around_set_states(hc_around *c, const double *x, size_t n);
/* States, derivatives or event indicators: HC_STATES, HC_DERIVATIVES, HC_INDICATORS. */
int hc_around_get_part(hc_around *c, int part, double *into, size_t n);
int hc_around_get_nominals(hc_around *c, double *x, size_t n);
int hc_around_completed_step(hc_around *c, int *event, int *terminate);
int hc_around_update(hc_around *c, hc_inner_event *event);
int hc_around_enter_event(hc_around *c);
int hc_around_enter_continuous(hc_around *c);
/* Ticks of the Block at its time, and inputs that arrive. */
int hc_around_tick(hc_around *c);
/* When the Block wants an event next: a tick, a switch, an arrival. */
double hc_around_next(const hc_around *c);

/* ---- hc_around_steps.c: Co-Simulation ---- */

/* Make the solver; begin the first step. */
int hc_around_solver(hc_around *c);
int hc_around_begin(hc_around *c);
int hc_around_step(hc_around *c, double time, double length);

/* ---- hc_around_state.c: saved states ---- */

int hc_around_state_get(hc_around *c, void **state);
int hc_around_state_set(hc_around *c, void *state);
int hc_around_state_free(hc_around *c, void **state);
int hc_around_state_size(hc_around *c, void *state, size_t *size);
int hc_around_state_write(hc_around *c, void *state, unsigned char *bytes, size_t size);
int hc_around_state_read(hc_around *c, const unsigned char *bytes, size_t size, void **state);

#endif
