/* See hc_runner.h. */
#include "hc_runner.h"
#include "hc_solver_internal.h"

#include <stdlib.h>
#include <string.h>

struct hc_runner {
    hc_solver *solver;
    double *u, *y;
};

hc_runner *hc_runner_new(const hc_model_type *model, const hc_options *options, double *y)
{
    hc_runner *runner = calloc(1, sizeof *runner);
    if (!runner)
        return NULL;
    runner->solver = hc_solver_new(model, options);
    runner->u = calloc((size_t)model->n_inputs + 1, sizeof *runner->u);
    runner->y = y;
    if (!runner->solver || !runner->u) {
        hc_runner_free(runner);
        return NULL;
    }
    runner->solver->short_steps = 1; /* a caller's steps are often much shorter than error control requires */
    return runner;
}

void hc_runner_free(hc_runner *runner)
{
    if (!runner)
        return;
    hc_solver_free(runner->solver);
    free(runner->u);
    free(runner);
}

static void look(hc_runner *runner)
{
    const hc_solver *s = runner->solver;
    s->model->outputs(s->t, s->x, s->u, s->p, s->mode, runner->y);
}

int hc_runner_begin(hc_runner *runner, double t, const double *x, const double *u, const double *p)
{
    const int status = hc_solver_set(runner->solver, t, x, u, p);
    look(runner);
    return status;
}

int hc_runner_step(hc_runner *runner, double until, const double *u)
{
    hc_solver *s = runner->solver;
    const size_t size = (size_t)s->model->n_inputs * sizeof *u;
    int status = HC_OK;
    if (size > 0 && memcmp(u, s->u, size) != 0) {
        memcpy(runner->u, u, size); /* u may be unaligned */
        for (int i = 0; i < s->model->n_inputs; i++)
            if (!hc_is_finite(runner->u[i]))
                return HC_INPUT_NOT_FINITE;
        status = hc_solver_set(s, s->t, NULL, runner->u, NULL);
    }
    if (status == HC_OK)
        status = hc_solver_advance(s, until);
    look(runner);
    return status;
}

int hc_runner_jump(hc_runner *runner, const double *x, const int *given, const double *p)
{
    hc_solver *s = runner->solver;
    double *held = s->ticks.ticked ? s->ticks.before : s->x + s->n;
    int status;
    for (int i = 0; i < s->n; i++)
        if (given[i])
            s->x[i] = x[i];
    for (int k = 0; k < s->n_held; k++)
        if (given[s->n + k])
            held[k] = x[s->n + k];
    status = hc_solver_set(s, s->t, NULL, NULL, p);
    look(runner);
    return status;
}

double hc_runner_time(const hc_runner *runner)
{
    return runner->solver->t;
}

void hc_runner_states(const hc_runner *runner, double *x)
{
    const hc_solver *s = runner->solver;
    memcpy(x, s->x, (size_t)s->model->n_states * sizeof *x);
}

long hc_runner_size(const hc_runner *runner)
{
    return (long)hc_solver_size(runner->solver);
}

void hc_runner_save(const hc_runner *runner, double *into)
{
    hc_solver_save(runner->solver, into);
}

void hc_runner_load(hc_runner *runner, const double *from)
{
    hc_solver_load(runner->solver, from);
    look(runner);
}
