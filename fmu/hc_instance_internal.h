/* Private to the runtime: shared declarations of the files of an instance. */
#ifndef HC_INSTANCE_INTERNAL_H
#define HC_INSTANCE_INTERNAL_H

#include "hc_instance.h"
#include "hc_solver_internal.h"

#define HC_HYSTERESIS 1e-9 /* of the velocity's nominal size, and of the largest friction |b| */

enum { TIME = 0, STATE, DERIVATIVE, INPUT, PARAMETER, OUTPUT, INDICATOR, MODE, UNKNOWN };
enum { VALID_STATES = 1, VALID_MODES = 2, VALID_DX = 4, VALID_Y = 8, VALID_Z = 16, VALID_PARTIALS = 32 };

/* ---- hc_messages.c ---- */

void hc_log_message(const hc_log_type *log, int status, const char *function, const char *format, ...) HC_FORMAT(4, 5);
/* Names of the states of an instance (bits of `states`), for messages. */
void hc_name_states(const hc_instance *c, unsigned states, char *text, size_t size);

/* ---- hc_values.c ---- */

static inline int hc_kind_of(const hc_instance *c, unsigned vr)
{
    for (int kind = TIME; kind <= MODE; kind++)
        if (vr < c->first[kind + 1])
            return kind;
    return UNKNOWN;
}

/* Place of a state, input or parameter in the arrays of the description. */
static inline unsigned hc_place_of(const hc_instance *c, int kind, unsigned vr)
{
    return vr - 1u - (kind == STATE ? 0u : (unsigned)c->model->n_states);
}

/* Name of a kind of variable, for messages. */
const char *hc_called(const hc_instance *c, unsigned vr, char text[200]);
int hc_fail_at(hc_instance *c, unsigned vr, const char *what);

/* Time, kept between the last and the next switch. */
static inline double hc_instance_time(const hc_instance *c)
{
    const double t = c->value[0];
    return t < c->earliest ? c->earliest : t > c->latest ? c->latest : t;
}

/* Find the friction modes that fit the states: a status of hc_solver.h. */
int hc_find_modes(hc_instance *c);
/* In Co-Simulation the states and modes are read inside the solver's last step, when they are needed. */
void hc_read_states(hc_instance *c);
/* Compute the values of a kind unless they are valid. */
void hc_evaluate(hc_instance *c, int kind);
/* HC_DISCARD if a value from `first` on is not finite: an integrator can try a shorter step. */
int hc_check_finite(hc_instance *c, unsigned vr);
/* Invalidate values that depend on what was set. */
void hc_invalidate(hc_instance *c);

/* ---- hc_instance.c ---- */

int hc_fail_ticks(hc_instance *c);
/* Pass the values that were set to the solver; execute the ticks of this time, or repeat them. */
int hc_tell_solver(hc_instance *c);
/* Compute the model's inputs from those that were set. In Continuous-Time Mode an importer may evaluate times out of
 * order, so delayed inputs, which are discrete, change at events only. */
int hc_take_inputs(hc_instance *c);
#if HC_DELAYS
/* Delays are fixed after initialization. */
int hc_refuse_late(hc_instance *c, int kind, unsigned vr, double value);
#endif

/* ---- hc_event_mode.c ---- */

void hc_log_modes(const hc_instance *c, const int *before, const int *after);
static inline int hc_is_at_rest(const hc_instance *c, int k)
{
    const int i = c->model->friction_state[k];
    return fabs(c->x[i]) <= HC_HYSTERESIS * hc_description.nominal[i];
}

/* ---- hc_saved_state.c ---- */

/* Copy the whole state to the buffer, or from it; pending delayed inputs come last. */
void hc_transfer(hc_instance *c, double *buffer, int load);
size_t hc_count_state(const hc_instance *c);

#endif
