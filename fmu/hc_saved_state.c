/* Save and restore the whole state of an instance, also as bytes. */
#include "hc_instance_internal.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    size_t count;
    double value[];
} state_type;

#define FORMAT 1 /* version of the byte format; the header is five 8-byte numbers */
#define HEAD 40u

static void copy(double *own, int n, double **buffer, int load)
{
    memcpy(load ? own : *buffer, load ? *buffer : own, (size_t)n * sizeof *own);
    *buffer += n;
}

enum { N_NUMBERS = 8, N_WHOLE = 8 };

/* Copy the whole state to the buffer, or from it; pending delayed inputs come last. */
void hc_transfer(hc_instance *c, double *buffer, int load)
{
    const hc_model_type *m = c->model;
    double *const numbers[N_NUMBERS] = {&c->earliest,   &c->latest,    &c->next_switch,
                                        &c->start_time, &c->stop_time, &c->rtol,
                                        &c->ticks.next, &c->ticks.at};
    double whole[N_WHOLE] = {c->kind,    c->state,          c->valid, c->updated,
                             c->changed, c->changed_before, c->event, c->ticks.ticked};
    copy(whole, N_WHOLE, &buffer, load);
    for (int i = 0; i < N_NUMBERS; i++)
        copy(numbers[i], 1, &buffer, load);
    copy(c->value, 1, &buffer, load);
    copy(c->x, m->n_states, &buffer, load);
    copy(c->u, m->n_inputs, &buffer, load);
    copy(c->p, m->n_parameters, &buffer, load);
    copy(c->ticks.due, (int)hc_ticks_size(m), &buffer, load);
    for (int k = 0; k < m->n_friction; k++) {
        double mode = c->mode[k];
        copy(&mode, 1, &buffer, load);
        c->mode[k] = (int)mode;
    }
    if (load) {
        c->state = (unsigned)whole[1];
        c->valid = (unsigned)whole[2] & (VALID_STATES | VALID_MODES);
        c->updated = (int)whole[3];
        c->changed = (int)whole[4];
        c->changed_before = (int)whole[5];
        c->event = (int)whole[6];
        c->ticks.ticked = (int)whole[7];
        if (c->solver)
            hc_solver_load(c->solver, buffer);
    } else if (c->solver) {
        hc_solver_save(c->solver, buffer);
    }
#if HC_DELAYS
    buffer += c->solver ? hc_solver_size(c->solver) : 0;
    if (load)
        hc_delays_load(c->delays, buffer);
    else
        hc_delays_save(c->delays, buffer);
#endif
}

/* Length without pending delayed inputs. */
static size_t count_fixed(const hc_instance *c)
{
    const hc_model_type *m = c->model;
    return N_WHOLE + N_NUMBERS + 1 + (size_t)(m->n_states + m->n_inputs + m->n_parameters + m->n_friction) +
           hc_ticks_size(m) +
           (c->solver ? hc_solver_size(c->solver) : 0);
}

size_t hc_count_state(const hc_instance *c)
{
#if HC_DELAYS
    return count_fixed(c) + hc_delays_count(c->delays);
#else
    return count_fixed(c);
#endif
}

/* Return whether a state fits this instance; if so, room for it is reserved. */
static int fits(hc_instance *c, const state_type *state)
{
#if HC_DELAYS
    const size_t fixed = count_fixed(c);
    if (state->count <= fixed || !hc_delays_fit(c->delays, state->value + fixed, state->count - fixed))
        return 0;
#else
    if (state->count != hc_count_state(c))
        return 0;
#endif
    return state->value[0] == c->kind;
}

/* Allocate `count` numbers at *state, or reuse its memory; NULL, with a message, if there is none. */
static state_type *room_for(hc_instance *c, void **state, size_t count)
{
    state_type *made = *state;
    if (made && made->count != count) {
#if HC_DELAYS
        free(made);
        *state = made = NULL;
#else
        hc_fail(c, "the FMU state to overwrite belongs to another kind of instance");
        return NULL;
#endif
    }
    if (!made)
        made = malloc(sizeof *made + count * sizeof(double));
    if (!made) {
        hc_fail(c, "no memory");
        return NULL;
    }
    made->count = count;
    *state = made;
    return made;
}

int hc_state_get(hc_instance *c, void **state)
{
    const size_t count = hc_count_state(c);
    state_type *made;
    if (hc_no_null(c, state, "FMUState", 1))
        return HC_ERROR;
    made = room_for(c, state, count);
    if (!made)
        return HC_ERROR;
    hc_transfer(c, made->value, 0);
    return HC_DONE;
}

/* Error if the state is missing, or belongs to an instance of the other kind. */
static int check_state(hc_instance *c, const state_type *state)
{
    if (hc_no_null(c, state, "FMUState", 1))
        return HC_ERROR;
    if (!fits(c, state))
        return hc_fail(c, "the FMU state is of another kind of instance: Model Exchange and Co-Simulation differ");
    return HC_DONE;
}

int hc_state_set(hc_instance *c, const void *state)
{
    if (check_state(c, state))
        return HC_ERROR;
    hc_transfer(c, ((state_type *)state)->value, 1);
    return HC_DONE;
}

int hc_state_free(hc_instance *c, void **state)
{
    (void)c;
    if (state) {
        free(*state);
        *state = NULL;
    }
    return HC_DONE;
}

/* FNV-1a, 64 bits */
static uint64_t digest(const unsigned char *bytes, size_t n, uint64_t hash)
{
    for (size_t i = 0; i < n; i++)
        hash = (hash ^ bytes[i]) * UINT64_C(1099511628211);
    return hash;
}

#define DIGEST_START UINT64_C(14695981039346656037)

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

static uint64_t digest_token(void)
{
    return digest((const unsigned char *)hc_description.token, strlen(hc_description.token), DIGEST_START);
}

#define MAGIC UINT64_C(0x31455441545f4348) /* "HC_STATE1", its first eight letters */

int hc_state_size(hc_instance *c, const void *state, size_t *size)
{
    if (hc_no_null(c, size, "size", 1) || check_state(c, state))
        return HC_ERROR;
    *size = HEAD + 8 * ((const state_type *)state)->count;
    return HC_DONE;
}

int hc_state_write(hc_instance *c, const void *state, unsigned char *bytes, size_t size)
{
    const state_type *from = state;
    size_t count;
    if (check_state(c, state) || hc_no_null(c, bytes, "serializedState", 1))
        return HC_ERROR;
    count = from->count;
    if (size != HEAD + 8 * count)
        return hc_fail(c, "room for %zu bytes where a state has %zu", size, HEAD + 8 * count);
    for (size_t i = 0; i < count; i++) {
        uint64_t number;
        memcpy(&number, from->value + i, sizeof number);
        write_number(bytes + HEAD + 8 * i, number);
    }
    write_number(bytes, MAGIC);
    write_number(bytes + 8, FORMAT);
    write_number(bytes + 16, digest_token());
    write_number(bytes + 24, count);
    write_number(bytes + 32, digest(bytes + HEAD, 8 * count, DIGEST_START));
    return HC_DONE;
}

int hc_state_read(hc_instance *c, const unsigned char *bytes, size_t size, void **state)
{
    const size_t count = HC_DELAYS && size >= HEAD ? (size - HEAD) / 8 : hc_count_state(c);
    const int fresh = state && !*state;
    state_type *made;
    if (hc_no_null(c, bytes, "serializedState", 1) || hc_no_null(c, state, "FMUState", 1))
        return HC_ERROR;
    if (size < HEAD || read_number(bytes) != MAGIC)
        return hc_fail(c, "these %zu bytes are no state of such an FMU", size);
    if (read_number(bytes + 8) != FORMAT)
        return hc_fail(c, "the state has format %lu, this FMU reads format %d",
                       (unsigned long)read_number(bytes + 8), FORMAT);
    if (read_number(bytes + 16) != digest_token())
        return hc_fail(c, "the state is of another FMU: its instantiation token differs");
    if (size != HEAD + 8 * count || read_number(bytes + 24) != count)
        return hc_fail(c, "the state has %zu bytes, one of this kind of instance has %zu", size, HEAD + 8 * count);
    if (read_number(bytes + 32) != digest(bytes + HEAD, 8 * count, DIGEST_START))
        return hc_fail(c, "the state is damaged: its checksum differs");
    made = room_for(c, state, count);
    if (!made)
        return HC_ERROR;
    for (size_t i = 0; i < count; i++) {
        const uint64_t number = read_number(bytes + HEAD + 8 * i);
        memcpy(made->value + i, &number, sizeof number);
    }
    if (check_state(c, made) == HC_DONE)
        return HC_DONE;
    if (fresh)
        hc_state_free(c, state);
    return HC_ERROR;
}
