/* Saved states of a corrected FMU: that of the inner FMU, then all numbers of the Block and of the solver. As bytes:
 * eight-byte numbers (mark, digest of the token, bytes of the inner state, count of doubles), inner state, doubles. */
#include "hc_around.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    void *inner;
    size_t count;
    double value[];
} state_type;

enum { N_NUMBERS = 12, N_WHOLE = 7, HEAD = 32 };
#define MAGIC UINT64_C(0x31444e554f524148) /* "HAROUND1" */

static const hc_around_table *const table = &hc_surroundings;

static void copy(double *own, size_t n, double **buffer, int load)
{
    if (n > 0)
        memcpy(load ? own : *buffer, load ? *buffer : own, n * sizeof *own);
    *buffer += n;
}

static size_t fixed_count(const hc_around *c)
{
    const hc_model_type *m = &hc_model;
    return 1 + N_NUMBERS + N_WHOLE + (size_t)(m->n_states + m->n_parameters + m->n_inputs + table->n_indicators) +
           hc_ticks_size(m) + (c->solver ? hc_solver_size(c->solver) : 0);
}

static size_t count_of(const hc_around *c)
{
    size_t count = fixed_count(c) + hc_history_count(&c->history);
#if HC_DELAYS
    count += hc_delays_count(c->delays);
#endif
    return count;
}

static void transfer(hc_around *c, double *buffer, int load)
{
    const hc_model_type *m = &hc_model;
    double *const numbers[N_NUMBERS] = {&c->t,           &c->start_time, &c->stop_time,  &c->rtol,
                                        &c->earliest,    &c->latest,     &c->next_switch, &c->inner_next,
                                        &c->ticks.next,  &c->ticks.at,   &c->t_start,     &c->t_end};
    double whole[N_WHOLE] = {c->kind, c->state, c->changed, c->ended, c->inner_event, c->ticks.ticked, c->solver != NULL};
    copy(whole, N_WHOLE, &buffer, load);
    for (int i = 0; i < N_NUMBERS; i++)
        copy(numbers[i], 1, &buffer, load);
    copy(c->x, (size_t)m->n_states, &buffer, load);
    copy(c->p, (size_t)m->n_parameters, &buffer, load);
    copy(c->u, (size_t)m->n_inputs, &buffer, load);
    copy(c->z_start, (size_t)table->n_indicators, &buffer, load);
    copy(c->ticks.due, hc_ticks_size(m), &buffer, load);
    if (load) {
        c->state = (unsigned)whole[1];
        c->changed = (int)whole[2];
        c->ended = (int)whole[3];
        c->inner_event = (int)whole[4];
        c->ticks.ticked = (int)whole[5];
        c->valid = c->ramp = 0;
    }
    if (c->solver && load) { /* the solver's only parameter is the address of this instance */
        hc_solver_load(c->solver, buffer);
        memcpy(c->solver->p, &c, sizeof c);
    } else if (c->solver) {
        hc_solver_save(c->solver, buffer);
    }
}

static int refuse(hc_around *c)
{
    return hc_around_fail(c, "the FMU state is of another kind of instance");
}

int hc_around_state_get(hc_around *c, void **state)
{
    state_type *made = state ? *state : NULL;
    double *end;
    int status;
    if (!state)
        return hc_around_fail(c, "FMUState is NULL");
    if (made && made->count != count_of(c)) {
        status = hc_around_state_free(c, state);
        if (status >= HC_DISCARD)
            return status;
        made = NULL;
    }
    if (!made) {
        made = malloc(sizeof *made + count_of(c) * sizeof(double));
        if (!made)
            return hc_around_fail(c, "no memory");
        made->inner = NULL;
        made->count = count_of(c);
    }
    status = hc_inner_save(c->inner, &made->inner);
    if (status >= HC_DISCARD) {
        free(made);
        *state = NULL;
        return hc_around_passed(c, status);
    }
    *state = made;
    made->value[0] = (double)fixed_count(c);
    transfer(c, made->value + 1, 0);
    end = made->value + fixed_count(c);
    hc_history_save(&c->history, end);
#if HC_DELAYS
    hc_delays_save(c->delays, end + hc_history_count(&c->history));
#endif
    return status;
}

/* Whether a saved state fits this instance; a solver is made or freed as the state has one. */
static int fits(hc_around *c, const state_type *saved)
{
    if (saved->count < 1 + N_WHOLE || saved->value[1] != c->kind)
        return 0;
    if (saved->value[N_WHOLE] == 0.0) { /* saved before initialization ended */
        hc_solver_free(c->solver);
        c->solver = NULL;
    } else if (!c->solver && hc_around_solver(c) != HC_DONE) {
        return 0;
    }
    return saved->value[0] == (double)fixed_count(c) && saved->count > fixed_count(c) + 1;
}

int hc_around_state_set(hc_around *c, void *state)
{
    const state_type *saved = state;
    const double *end;
    size_t left, own;
    int status;
    if (!saved || !fits(c, saved))
        return saved ? refuse(c) : hc_around_fail(c, "FMUState is NULL");
    end = saved->value + fixed_count(c);
    left = saved->count - fixed_count(c);
    own = end[0] >= 0.0 && end[0] <= (double)left ? (size_t)end[0] : 0;
    if (!hc_history_load(&c->history, end, own))
        return refuse(c);
#if HC_DELAYS
    if (!hc_delays_fit(c->delays, end + own, left - own))
        return refuse(c);
    hc_delays_load(c->delays, end + own);
#else
    if (left != own)
        return refuse(c);
#endif
    transfer(c, (double *)saved->value + 1, 1);
    status = hc_inner_load(c->inner, saved->inner);
    return hc_around_passed(c, status);
}

int hc_around_state_free(hc_around *c, void **state)
{
    state_type *saved = state ? *state : NULL;
    int status = HC_DONE;
    if (!saved)
        return HC_DONE;
    if (saved->inner)
        status = hc_inner_forget(c->inner, &saved->inner);
    free(saved);
    *state = NULL;
    return hc_around_passed(c, status);
}

/* ---- as bytes ---- */

static uint64_t digest_token(void)
{
    uint64_t hash = UINT64_C(14695981039346656037); /* FNV-1a */
    for (const char *c = table->token; *c; c++)
        hash = (hash ^ (unsigned char)*c) * UINT64_C(1099511628211);
    return hash;
}

static void write_number(unsigned char *bytes, uint64_t number)
{
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(number >> 8 * i & 0xff);
}

static uint64_t read_number(const unsigned char *bytes)
{
    uint64_t number = 0;
    for (int i = 0; i < 8; i++)
        number |= (uint64_t)bytes[i] << 8 * i;
    return number;
}

int hc_around_state_size(hc_around *c, void *state, size_t *size)
{
    const state_type *saved = state;
    size_t inner = 0;
    int status;
    if (!saved || !size)
        return hc_around_fail(c, "FMUState or size is NULL");
    status = hc_inner_bytes(c->inner, saved->inner, &inner);
    *size = HEAD + inner + 8 * saved->count;
    return hc_around_passed(c, status);
}

int hc_around_state_write(hc_around *c, void *state, unsigned char *bytes, size_t size)
{
    const state_type *saved = state;
    size_t inner = 0;
    int status;
    if (!saved || !bytes)
        return hc_around_fail(c, "FMUState or serializedState is NULL");
    status = hc_inner_bytes(c->inner, saved->inner, &inner);
    if (status < HC_DISCARD && size != HEAD + inner + 8 * saved->count)
        return hc_around_fail(c, "room for %zu bytes where a state has %zu", size, HEAD + inner + 8 * saved->count);
    if (status < HC_DISCARD)
        status = hc_inner_write(c->inner, saved->inner, bytes + HEAD, inner);
    if (status >= HC_DISCARD)
        return hc_around_passed(c, status);
    write_number(bytes, MAGIC);
    write_number(bytes + 8, digest_token());
    write_number(bytes + 16, inner);
    write_number(bytes + 24, saved->count);
    for (size_t i = 0; i < saved->count; i++) {
        uint64_t number;
        memcpy(&number, saved->value + i, sizeof number);
        write_number(bytes + HEAD + inner + 8 * i, number);
    }
    return status;
}

int hc_around_state_read(hc_around *c, const unsigned char *bytes, size_t size, void **state)
{
    uint64_t inner, count;
    state_type *made;
    int status;
    if (!bytes || !state)
        return hc_around_fail(c, "serializedState or FMUState is NULL");
    if (size < HEAD || read_number(bytes) != MAGIC || read_number(bytes + 8) != digest_token())
        return hc_around_fail(c, "these %zu bytes are no state of this FMU", size);
    inner = read_number(bytes + 16);
    count = read_number(bytes + 24);
    if (inner > size - HEAD || count != (size - HEAD - inner) / 8 || size != HEAD + inner + 8 * count)
        return hc_around_fail(c, "these %zu bytes are no state of this FMU", size);
    status = hc_around_state_free(c, state);
    made = malloc(sizeof *made + (size_t)count * sizeof(double));
    if (!made)
        return hc_around_fail(c, "no memory");
    made->inner = NULL;
    made->count = (size_t)count;
    for (size_t i = 0; i < made->count; i++) {
        const uint64_t number = read_number(bytes + HEAD + inner + 8 * i);
        memcpy(made->value + i, &number, sizeof number);
    }
    if (status < HC_DISCARD)
        status = hc_inner_read(c->inner, bytes + HEAD, (size_t)inner, &made->inner);
    if (status >= HC_DISCARD) {
        free(made);
        return hc_around_passed(c, status);
    }
    *state = made;
    return status;
}
