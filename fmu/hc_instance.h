/* Private to the runtime: one instance of an FMU, for both versions of FMI. hc_fmi2.c and hc_fmi3.c wrap it with the
 * names and types of their standard.
 *
 * Value references, with n states, m inputs, q parameters, l outputs, k dry frictions:
 *     0 time, n states, n derivatives, m inputs, q parameters, l outputs, k event indicators: reals;
 *     then k friction modes: integers.
 * `value` holds the real numbers in this order.
 *
 * Functions that return int return a status; on HC_ERROR and HC_DISCARD a message was logged. After
 * HC_ERROR the instance is in the state HC_FAILED: it can be read, reset, restored and freed.
 */
#ifndef HC_INSTANCE_H
#define HC_INSTANCE_H

#include <stddef.h>

#include "hc_delays.h"
#include "hc_description.h"
#include "hc_solver.h"
#include "hc_ticks.h"

enum { HC_DONE = 0, HC_WARNING = 1, HC_DISCARD = 2, HC_ERROR = 3 }; /* as FMI 2 and FMI 3 number them */

enum { HC_MODEL_EXCHANGE = 0, HC_CO_SIMULATION = 1 };

enum {
    HC_INSTANTIATED = 1,
    HC_INITIALIZATION = 2,
    HC_EVENT = 4,
    HC_CONTINUOUS_TIME = 8,
    HC_STEP = 16,
    HC_TERMINATED = 32,
    HC_FAILED = 64,
    HC_INTERMEDIATE = 128 /* Intermediate Update Mode of FMI 3: in a callback within a step */
};

/* Of the discrete states in Event Mode; HC_AT_START: not yet, and initialization has just ended. */
enum { HC_NOT_UPDATED = 0, HC_UPDATED = 1, HC_AT_START = 2 };

/* Sets of states in which calls are allowed. */
enum {
    INITIALIZED = HC_EVENT | HC_CONTINUOUS_TIME | HC_STEP,
    ENDED = HC_TERMINATED | HC_FAILED,
    ANY = HC_INSTANTIATED | HC_INITIALIZATION | INITIALIZED | ENDED,
    COMPUTED = HC_INITIALIZATION | INITIALIZED | ENDED, /* equations are active */
    SETTABLE = HC_INSTANTIATED | HC_INITIALIZATION | INITIALIZED,
    DISCRETE = HC_INSTANTIATED | HC_INITIALIZATION | HC_EVENT | HC_STEP
};

/* The importer's logger. A bit of `categories` is a status: 1 << HC_DONE is logEvents, and so on. */
typedef struct hc_log_type {
    int version; /* of FMI */
    const char *instance;
    void *environment;
    void (*callback)(void); /* of the type that `emit` expects; NULL: nothing is logged */
    void (*emit)(const struct hc_log_type *log, int status, const char *category, const char *message);
    unsigned categories;
} hc_log_type;

typedef struct hc_instance {
    hc_log_type log;
    int kind, event_mode_used, early_return_allowed;
    unsigned state;       /* one bit */
    const char *function; /* the current call, for messages */
    char *name;

    const hc_model_type *model;
    double *value, *x, *dx, *u, *p, *y, *z; /* `value` as above, and the start of its parts */
    double *in;            /* inputs of the model; u if none is delayed */
    hc_delays *delays;     /* NULL: no delayed inputs */
    int *mode, *mode_before;
    unsigned first[9]; /* value reference at which each kind of variable begins, and the end */
    unsigned valid;    /* parts of `value` that are up to date */
    double *a, *b, *partial, *seed, *product; /* work space */

    double earliest, latest, next_switch; /* the model is evaluated only from earliest to latest */
    double start_time, stop_time;         /* DBL_MAX: none */
    double rtol;
    int updated; /* whether discrete states were updated in this Event Mode */

    hc_ticks ticks;    /* Model Exchange only: the solver has its own */
    hc_solver *solver; /* Co-Simulation only */
    void (*intermediate)(void); /* the importer's callback of FMI 3, of the type that `update` expects; NULL: none */
    int (*update)(struct hc_instance *c, int can_return); /* calls it at the instance's time; 1: return early */
    int changed;       /* values were set and not yet passed to the solver */
    int changed_before; /* the same at the last step */
    int event;         /* the solver's last step ended at an event */
    int states_set;    /* how often the importer set the states since it last completed a step */
    double *initial;   /* the state of a new instance */
    unsigned *expanded; /* work space of FMI 3: value references with arrays as their elements, of several lists */
    size_t n_expanded;
    char *told;        /* 1: a value out of bounds was logged; states, inputs, parameters */
} hc_instance;

/* Number of continuous states; held states follow them. */
static inline size_t hc_n_continuous(const hc_instance *c)
{
    return (size_t)(c->model->n_states - c->model->n_held);
}

/* ---- instances and modes ---- */

/* NULL, with a message, on a wrong token, an empty name, or no memory. */
hc_instance *hc_instance_new(const hc_log_type *log, const char *function, int kind, const char *name,
                               const char *token);
void hc_instance_free(hc_instance *c);

/* Called first by every function: 0, with a message, if the call is not allowed in the current state. */
int hc_refuse_state(hc_instance *c, unsigned allowed);
int hc_refuse_kind(hc_instance *c, int kind);
static inline int hc_enter(hc_instance *c, const char *function, unsigned allowed)
{
    if (!c)
        return 0;
    c->function = function;
    return (c->state & allowed) != 0 || hc_refuse_state(c, allowed);
}
static inline int hc_enter_kind(hc_instance *c, const char *function, unsigned allowed, int kind)
{
    return hc_enter(c, function, allowed) && (c->kind == kind || hc_refuse_kind(c, kind));
}

#if defined __GNUC__
#define HC_FORMAT(text, values) __attribute__((format(printf, text, values)))
#else
#define HC_FORMAT(text, values)
#endif
int hc_fail(hc_instance *c, const char *format, ...) HC_FORMAT(2, 3);
int hc_discard(hc_instance *c, const char *format, ...) HC_FORMAT(2, 3);
int hc_not_supported(hc_instance *c, const char *what);
/* Error if a pointer to values is NULL. */
int hc_no_null(hc_instance *c, const void *pointer, const char *name, size_t n);
/* In FMI 2 only the given categories are logged from now on; in FMI 3 the others are unchanged. */
int hc_set_logging(hc_instance *c, int on, size_t n, const char *const categories[]);

int hc_set_experiment(hc_instance *c, int has_tolerance, double tolerance, double start, int has_stop, double stop);
int hc_exit_initialization(hc_instance *c);
int hc_reset(hc_instance *c);
static inline int hc_terminate(hc_instance *c)
{
    c->state = HC_TERMINATED;
    return HC_DONE;
}

/* ---- values ---- */

int hc_get_reals(hc_instance *c, const unsigned *vr, size_t n, double *value);
int hc_get_modes(hc_instance *c, const unsigned *vr, size_t n, int *value);
int hc_set_reals(hc_instance *c, const unsigned *vr, size_t n, const double *value);
/* For types without variables, and to set modes: an error unless n is 0. */
int hc_no_variable(hc_instance *c, const char *type, const unsigned *vr, size_t n);

/* Products with the matrix of partial derivatives of derivatives and outputs by states, inputs and parameters:
 * sensitivity = J seed, or (adjoint) J' seed. `n_seed` and `n_sensitivity` must equal the
 * numbers of knowns and unknowns. */
int hc_partial_derivatives(hc_instance *c, int adjoint, const unsigned *unknown, size_t n_unknown,
                           const unsigned *known, size_t n_known, const double *seed, double *sensitivity);

/* First derivatives of outputs by time, while inputs hold. */
int hc_output_derivatives(hc_instance *c, const unsigned *vr, const int *order, size_t n, double *value);

/* ---- Model Exchange ---- */

enum { HC_STATES = 1, HC_DERIVATIVES = 2, HC_INPUTS = 3, HC_PARAMETERS = 4, HC_OUTPUTS = 5, HC_INDICATORS = 6 };

int hc_set_time(hc_instance *c, double time);
int hc_set_states(hc_instance *c, const double *x, size_t n);
/* Copy one part of `value`, or the nominal sizes of the states. */
int hc_get_part(hc_instance *c, int part, double *into, size_t n);
int hc_get_nominals(hc_instance *c, double *into, size_t n);
/* The time of the next tick, switch or arrival of a delayed input; DBL_MAX: none. */
double hc_next_event(const hc_instance *c);
int hc_completed_step(hc_instance *c, int *enter_event_mode);
int hc_enter_event_mode(hc_instance *c);
/* `next` is DBL_MAX where there is no next event. */
int hc_update_discrete_states(hc_instance *c, int *states_changed, double *next);
int hc_leave_event_mode(hc_instance *c, unsigned state);
static inline int hc_enter_continuous(hc_instance *c)
{
    return hc_leave_event_mode(c, HC_CONTINUOUS_TIME);
}

/* ---- Co-Simulation ---- */

/* On return the instance's time is the time reached. */
int hc_do_step(hc_instance *c, double time, double length, int *event, int *early);

/* ---- saved state ---- */

int hc_state_get(hc_instance *c, void **state);
int hc_state_set(hc_instance *c, const void *state);
int hc_state_free(hc_instance *c, void **state);
int hc_state_size(hc_instance *c, const void *state, size_t *size);
int hc_state_write(hc_instance *c, const void *state, unsigned char *bytes, size_t size);
int hc_state_read(hc_instance *c, const unsigned char *bytes, size_t size, void **state);

#endif
