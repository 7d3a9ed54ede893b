/* Private to the runtime: what the files of an instance share. */
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

/* As a person would call it, for messages. */
const char *hc_called(const hc_instance *c, unsigned vr, char text[200]);
int hc_fail_at(hc_instance *c, unsigned vr, const char *what);

/* Time as the model may see it. */
static inline double hc_instance_time(const hc_instance *c)
{
    const double t = c->value[0];
    return t < c->earliest ? c->earliest : t > c->latest ? c->latest : t;
}

/* Find the friction modes that fit the states: a status of hc_solver.h. */
int hc_find_modes(hc_instance *c);
/* In Co-Simulation the states and modes are read inside the solver's last step, when they are needed. */
void hc_read_states(hc_instance *c);
/* Compute the values of a kind, if they are not known. */
void hc_evaluate(hc_instance *c, int kind);
/* HC_DISCARD where value i from `first` on is no number: an integrator can try a shorter step. */
int hc_check_finite(hc_instance *c, unsigned vr);
/* Forget what depends on what was set. */
void hc_invalidate(hc_instance *c);

/* ---- hc_instance.c ---- */

int hc_fail_ticks(hc_instance *c);
/* Hand the solver what was set; ticks of this time are taken, or taken again. */
int hc_tell_solver(hc_instance *c);
/* What the model sees of the inputs that were set. In Continuous-Time Mode an importer may try times out of order: late
 * inputs, which are discrete, wait for the next event. */
int hc_take_inputs(hc_instance *c);
#if HC_DELAYS
/* What says how late inputs act is fixed. */
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

/* Copy all that the instance knows to the buffer, or from it; what is under way comes last. */
void hc_transfer(hc_instance *c, double *buffer, int load);
size_t hc_count_state(const hc_instance *c);

#endif
