/* Whole simulations and sweeps: see hc_simulate.h. Steps run over the grid's times, which are read inside them; only
 * where an input jumps and at the end does a step stop. */
#include "hc_simulate.h"
#include "hc_steps.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const double *times;
    long n_times;
    const double *u; /* n_times rows, or NULL */
} grid_type;

static const double *inputs_at(const hc_model_type *model, const grid_type *grid, long row)
{
    return grid->u ? grid->u + row * model->n_inputs : NULL;
}

static int inputs_jump(const hc_model_type *model, const grid_type *grid, long row)
{
    return grid->u && memcmp(inputs_at(model, grid, row), inputs_at(model, grid, row - 1),
                             (size_t)model->n_inputs * sizeof(double)) != 0;
}

/* Write one row of results, with the states at that time left in x. */
static void write_row(hc_solver *solver, const hc_model_type *model, const grid_type *grid, long row, double *x,
                      const double *p, double *states, double *outputs)
{
    const int *mode = hc_solver_inside(solver, grid->times[row], x);
    if (states)
        memcpy(states + row * model->n_states, x, (size_t)model->n_states * sizeof *x);
    if (outputs)
        model->outputs(grid->times[row], x, inputs_at(model, grid, row), p, mode, outputs + row * model->n_outputs);
}

static int run(hc_solver *solver, const hc_model_type *model, const grid_type *grid, double *x, const double *p,
               double *states, double *outputs)
{
    long row = 0, stop = 0;
    hc_solver_restart(solver);
    int status = hc_solver_set(solver, grid->times[0], x, inputs_at(model, grid, 0), p);
    while (status == HC_OK) {
        write_row(solver, model, grid, row++, x, p, states, outputs);
        if (row == grid->n_times)
            break;
        if (row > stop) /* the next time at which to stop */
            for (stop = row; stop < grid->n_times - 1 && !inputs_jump(model, grid, stop);)
                stop++;
        while (status == HC_OK && hc_solver_time(solver) < grid->times[row])
            status = hc_solver_step(solver, grid->times[stop]);
        if (status == HC_OK && row == stop && inputs_jump(model, grid, stop))
            status = hc_solver_set(solver, grid->times[stop], NULL, inputs_at(model, grid, stop), NULL);
    }
    memcpy(x, hc_solver_states(solver), (size_t)model->n_states * sizeof *x);
    if (states)
        for (long i = row * model->n_states; i < grid->n_times * model->n_states; i++)
            states[i] = NAN;
    if (outputs)
        for (long i = row * model->n_outputs; i < grid->n_times * model->n_outputs; i++)
            outputs[i] = NAN;
    return status;
}

int hc_simulate(const hc_model_type *model, const hc_options *options, const double *times, long n_times,
                double *x, const double *u, const double *p, double *states, double *outputs, double *reached)
{
    const grid_type grid = {times, n_times, u};
    hc_solver *solver = hc_solver_new(model, options);
    if (!solver)
        return HC_NO_MEMORY;
    const int status = run(solver, model, &grid, x, p, states, outputs);
    if (reached)
        *reached = hc_solver_time(solver);
    hc_solver_free(solver);
    return status;
}

/* Figures of column `output` of a run's outputs (rows of n), from row `first` on. */
static void summarise(const grid_type *grid, long first, const double *column, int n, double band, double *figures)
{
    const long last = grid->n_times - 1;
    const double *times = grid->times, final = column[last * n];
    double largest = final, smallest = final, integral = 0.0;
    long settled = last;
    for (long row = first; row <= last; row++) {
        const double y = column[row * n];
        largest = y > largest ? y : largest;
        smallest = y < smallest ? y : smallest;
        if (row > first) {
            const double before = column[(row - 1) * n];
            integral += 0.5 * (times[row] - times[row - 1]) * (before * before + y * y);
        }
    }
    while (settled > first && fabs(column[(settled - 1) * n] - final) <= band)
        settled--;
    figures[HC_FINAL] = final;
    figures[HC_MAX] = largest;
    figures[HC_MIN] = smallest;
    figures[HC_RMS] = last > first ? sqrt(integral / (times[last] - times[first])) : fabs(final);
    figures[HC_SETTLING] = times[settled];
}

int hc_sweep(const hc_model_type *model, const hc_options *options, const double *times, long n_times,
             long n_runs, const double *x, const double *u, const double *p, double from, const double *band,
             double *figures, double *final, int *status)
{
    const int n = model->n_states, n_outputs = model->n_outputs;
    const grid_type grid = {times, n_times, u};
    hc_solver *solver = hc_solver_new(model, options);
    double *states = malloc(((size_t)n + 1) * sizeof *states);
    double *outputs = malloc(((size_t)n_times * (size_t)n_outputs + 1) * sizeof *outputs);
    long first = 0;
    if (!solver || !states || !outputs) {
        hc_solver_free(solver);
        free(states);
        free(outputs);
        return HC_NO_MEMORY;
    }
    while (first < n_times - 1 && times[first] < times[0] + from)
        first++;
    for (long i = 0; i < n_runs; i++) {
        double *figure = figures + i * n_outputs * HC_N_FIGURES;
        memcpy(states, x + i * n, (size_t)n * sizeof *states);
        status[i] = run(solver, model, &grid, states, p + i * model->n_parameters, NULL, outputs);
        for (int j = 0; j < n_outputs; j++, figure += HC_N_FIGURES)
            if (status[i] == HC_OK)
                summarise(&grid, first, outputs + j, n_outputs, band[j], figure);
            else
                for (int kind = 0; kind < HC_N_FIGURES; kind++)
                    figure[kind] = NAN;
        if (final)
            memcpy(final + i * n, states, (size_t)n * sizeof *final);
    }
    hc_solver_free(solver);
    free(states);
    free(outputs);
    return HC_OK;
}
