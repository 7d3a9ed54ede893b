/* The whole state of a solver as doubles. */
#include "hc_solver_internal.h"

#include <string.h>

/* Copy n numbers to the buffer, or from it, and advance. */
static void copy(double *own, int n, double **buffer, int load)
{
    memcpy(load ? own : *buffer, load ? *buffer : own, (size_t)n * sizeof *own);
    *buffer += n;
}

enum { N_NUMBERS = 13, N_ARRAYS = 3, N_WHOLE = 8 };

/* Integers below 2^53 are exact doubles; work space is not saved. */
static void transfer(hc_solver *s, double *buffer, int load)
{
    double *const numbers[N_NUMBERS] = {&s->rtol,        &s->longest, &s->t,      &s->earliest, &s->latest,
                                        &s->next_switch, &s->t0,      &s->length, &s->h,        &s->log_error,
                                        &s->t_event,     &s->ticks.next, &s->ticks.at};
    double *const arrays[N_ARRAYS] = {s->f, s->f0, s->absolute};
    int *const whole[N_WHOLE] = {&s->method, &s->fresh, &s->f_open, &s->has_dense, &s->events_here,
                                 &s->cubic, &s->started, &s->ticks.ticked};
    const int n_all = s->n + s->n_held;
    double steps = (double)s->steps;
    for (int i = 0; i < N_NUMBERS; i++)
        copy(numbers[i], 1, &buffer, load);
    for (int i = 0; i < N_ARRAYS; i++)
        copy(arrays[i], s->n, &buffer, load);
    for (int j = 0; j < s->n_k; j++)
        copy(s->k[j], s->n, &buffer, load);
    for (int j = 0; j < s->n_dense; j++)
        copy(s->dense[j], s->n, &buffer, load);
    copy(s->x, n_all, &buffer, load);
    copy(s->x0, n_all, &buffer, load);
    copy(s->u, s->model->n_inputs, &buffer, load);
    copy(s->p, s->model->n_parameters, &buffer, load);
    copy(s->ticks.due, (int)hc_ticks_size(s->model), &buffer, load);
    copy(&steps, 1, &buffer, load);
    s->steps = (long)steps;
    for (int i = 0; i < N_WHOLE; i++) {
        double number = *whole[i];
        copy(&number, 1, &buffer, load);
        *whole[i] = (int)number;
    }
    for (int k = 0; k < 4; k++) {
        double count = (double)s->counts[k];
        copy(&count, 1, &buffer, load);
        s->counts[k] = (long)count;
    }
    for (int k = 0; k < 2 * s->n_friction; k++) { /* mode, then mode0 */
        double mode = s->mode[k];
        copy(&mode, 1, &buffer, load);
        s->mode[k] = (int)mode;
    }
}

size_t hc_solver_size(const hc_solver *s)
{
    const int n_all = s->n + s->n_held;
    return (size_t)(N_NUMBERS + (N_ARRAYS + s->n_k + s->n_dense) * s->n + 2 * n_all + s->model->n_inputs +
                    s->model->n_parameters + 1 + N_WHOLE + 4 + 2 * s->n_friction) +
           hc_ticks_size(s->model);
}

void hc_solver_save(const hc_solver *s, double *into)
{
    transfer((hc_solver *)s, into, 0); /* with these arguments it only reads */
}

void hc_solver_load(hc_solver *s, const double *from)
{
    transfer(s, (double *)from, 1);
}
