/* Whole simulations and sweeps: see hc_simulate.h. Steps may pass the grid's times, where states are interpolated; a
 * step ends only where an input jumps and at the end. */
#include "hc_runs.h"

#include <stdlib.h>
#include <string.h>

/* ---- a part of a larger system ---- */

static int n_all(const hc_model_type *model, const hc_part *part)
{
    return part ? part->n_all : model->n_states;
}

static void gather(const hc_model_type *model, const hc_part *part, const double *all, double *x)
{
    for (int i = 0; i < model->n_states; i++)
        x[i] = all[part ? part->place[i] : i];
}

static void spread(const hc_model_type *model, const hc_part *part, const double *x, double *all)
{
    memset(all, 0, (size_t)n_all(model, part) * sizeof *all);
    for (int i = 0; i < model->n_states; i++)
        all[part ? part->place[i] : i] = x[i];
}

/* ---- one run ---- */

static const double *inputs_at(const hc_run *run, long row)
{
    return run->grid->u ? run->grid->u + row * run->solver->model->n_inputs : NULL;
}

static int inputs_jump(const hc_run *run, long row)
{
    return run->grid->u && memcmp(inputs_at(run, row), inputs_at(run, row - 1),
                                  (size_t)run->solver->model->n_inputs * sizeof(double)) != 0;
}

static void write_row(hc_run *run)
{
    const hc_model_type *model = run->solver->model;
    const double t = run->grid->times[run->row];
    const int *mode = hc_solver_inside(run->solver, t, run->x);
    if (run->states)
        spread(model, run->part, run->x, run->states + run->row * n_all(model, run->part));
    if (run->outputs)
        model->outputs(t, run->x, inputs_at(run, run->row), run->solver->p, mode,
                       run->outputs + run->row * model->n_outputs);
    run->row++;
}

/* Write the rows up to the solver's time, and apply input steps. */
static void arrive(hc_run *run)
{
    const hc_grid *grid = run->grid;
    while (hc_run_goes_on(run) && run->solver->t >= grid->times[run->row]) {
        if (run->row == run->stop && inputs_jump(run, run->row))
            run->status = hc_solver_set(run->solver, grid->times[run->row], NULL, inputs_at(run, run->row), NULL);
        if (run->status != HC_OK)
            return;
        write_row(run);
        if (run->row > run->stop) /* the next time at which to stop */
            for (run->stop = run->row; run->stop < grid->n_times - 1 && !inputs_jump(run, run->stop);)
                run->stop++;
    }
}

void hc_run_begin(hc_run *run, const double *x0, const double *p)
{
    run->row = 0;
    run->stop = -1;
    gather(run->solver->model, run->part, x0, run->x);
    hc_solver_restart(run->solver);
    run->status = hc_solver_set(run->solver, run->grid->times[0], run->x, inputs_at(run, 0), p);
    arrive(run);
}

void hc_run_step(hc_run *run)
{
    run->status = hc_solver_step(run->solver, run->grid->times[run->stop]);
    arrive(run);
}

void hc_run_end(hc_run *run, double *x_end)
{
    const hc_model_type *model = run->solver->model;
    const int n = n_all(model, run->part), n_outputs = model->n_outputs;
    if (x_end)
        spread(model, run->part, run->solver->x, x_end);
    for (long i = run->row * n; run->states && i < run->grid->n_times * n; i++)
        run->states[i] = NAN;
    for (long i = run->row * n_outputs; run->outputs && i < run->grid->n_times * n_outputs; i++)
        run->outputs[i] = NAN;
}

static void run_to_the_end(hc_run *run)
{
    while (hc_run_goes_on(run))
        hc_run_step(run);
}

static int open_run(hc_run *run, const hc_model_type *model, const hc_part *part, const hc_options *options,
                    const hc_grid *grid)
{
    run->grid = grid;
    run->part = part;
    run->solver = hc_solver_new(model, options);
    run->x = malloc(((size_t)model->n_states + 1) * sizeof *run->x);
    if (!run->solver || !run->x)
        return HC_NO_MEMORY;
    run->solver->n_mean = n_all(model, part) - model->n_held;
    return HC_OK;
}

static void close_run(hc_run *run)
{
    hc_solver_free(run->solver);
    free(run->x);
}

int hc_simulate_part(const hc_model_type *model, const hc_part *part, const hc_options *options, const double *times,
                     long n_times, double *x, const double *u, const double *p, double *states, double *outputs,
                     double *reached)
{
    const hc_grid grid = {times, n_times, u};
    hc_run run = {0};
    int status = open_run(&run, model, part, options, &grid);
    run.states = states;
    run.outputs = outputs;
    if (status == HC_OK) {
        hc_run_begin(&run, x, p);
        run_to_the_end(&run);
        hc_run_end(&run, x);
        status = run.status;
        if (reached)
            *reached = run.solver->t;
    }
    close_run(&run);
    return status;
}

int hc_simulate(const hc_model_type *model, const hc_options *options, const double *times, long n_times,
                double *x, const double *u, const double *p, double *states, double *outputs, double *reached)
{
    return hc_simulate_part(model, NULL, options, times, n_times, x, u, p, states, outputs, reached);
}

int hc_advance(const hc_model_type *model, const hc_options *options, double t, double until, double *x,
               const double *u, const double *p)
{
    hc_solver *solver = hc_solver_new(model, options);
    int status;
    if (!solver)
        return HC_NO_MEMORY;
    if (until > t)
        solver->quiet_from = until;
    status = hc_solver_set(solver, t, x, u, p);
    if (status == HC_OK)
        status = hc_solver_advance(solver, until);
    memcpy(x, hc_solver_states(solver), (size_t)model->n_states * sizeof *x);
    hc_solver_free(solver);
    return status;
}

/* ---- sweeps ---- */

/* Figures of merit of column `output` of a run's outputs (rows of n), from row `first` on. */
static void summarise(const hc_grid *grid, long first, const double *column, int n, double band, double *figures)
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

/* Number of runs at once: HC_LANES if lanes can step them and take several steps per row. */
static int width(hc_lanes_function lanes, const hc_options *options, const hc_grid *grid, long n_runs)
{
    const double rows = (grid->times[grid->n_times - 1] - grid->times[0]) / (double)grid->n_times;
    return lanes && options->method == HC_RK4 && options->max_steps == 0 && rows > 3.0 * options->step && n_runs > 2
               ? HC_LANES
               : 1;
}

int hc_sweep_part(const hc_model_type *model, const hc_part *part, hc_lanes_function lanes, const hc_options *options,
                  const double *times, long n_times, long n_runs, const double *x, const double *u, const double *p,
                  double from, const double *band, double *figures, double *final, int *status)
{
    const int n = n_all(model, part), n_outputs = model->n_outputs;
    const hc_grid grid = {times, n_times, u};
    const int wide = width(lanes, options, &grid, n_runs);
    const size_t table = (size_t)n_times * (size_t)n_outputs;
    double *outputs = malloc(((size_t)wide * table + 1) * sizeof *outputs);
    hc_lanes *side_by_side = wide > 1 ? hc_lanes_new(model, lanes, options->step) : NULL;
    hc_run runs[HC_LANES] = {{0}};
    int result = outputs && (side_by_side || wide == 1) ? HC_OK : HC_NO_MEMORY;
    long first = 0;
    while (first < n_times - 1 && times[first] < times[0] + from)
        first++;
    for (int l = 0; l < wide && result == HC_OK; l++) {
        result = open_run(&runs[l], model, part, options, &grid);
        runs[l].outputs = outputs + (size_t)l * table;
    }
    for (long i = 0; i < n_runs && result == HC_OK; i += wide) {
        const int count = n_runs - i < wide ? (int)(n_runs - i) : wide;
        for (int l = 0; l < count; l++)
            hc_run_begin(&runs[l], x + (i + l) * n, p + (i + l) * model->n_parameters);
        if (side_by_side)
            hc_lanes_run(side_by_side, runs, count);
        for (int l = 0; l < count; l++) {
            double *figure = figures + (i + l) * n_outputs * HC_N_FIGURES;
            run_to_the_end(&runs[l]);
            hc_run_end(&runs[l], final ? final + (i + l) * n : NULL);
            status[i + l] = runs[l].status;
            for (int j = 0; j < n_outputs; j++, figure += HC_N_FIGURES)
                if (runs[l].status == HC_OK)
                    summarise(&grid, first, runs[l].outputs + j, n_outputs, band[j], figure);
                else
                    for (int kind = 0; kind < HC_N_FIGURES; kind++)
                        figure[kind] = NAN;
        }
    }
    for (int l = 0; l < wide; l++)
        close_run(&runs[l]);
    hc_lanes_free(side_by_side);
    free(outputs);
    return result;
}

int hc_sweep(const hc_model_type *model, const hc_options *options, const double *times, long n_times,
             long n_runs, const double *x, const double *u, const double *p, double from, const double *band,
             double *figures, double *final, int *status)
{
    return hc_sweep_part(model, NULL, NULL, options, times, n_times, n_runs, x, u, p, from, band, figures, final, status);
}
