/* Every function of the runtime on hc_model with parameters from the command line, for a run under the sanitisers:
 * both methods, whole simulations with inputs that jump, a sweep, single steps. Prints the statuses. */
#include "hc_simulate.h"

#include <stdio.h>
#include <stdlib.h>

#ifndef LANES
#define LANES NULL
#endif

enum { N_TIMES = 301, N_RUNS = 3 };

static double *doubles(int n)
{
    double *array = calloc((size_t)n, sizeof *array); /* no spare room: the sanitiser sees one element too far */
    if (!array && n > 0)
        exit(3);
    return array;
}

int main(int argc, char **argv)
{
    const hc_model_type *m = &hc_model;
    double *times = doubles(N_TIMES), *u = doubles(N_TIMES * m->n_inputs), *p = doubles(N_RUNS * m->n_parameters);
    double *x = doubles(N_RUNS * m->n_states), *final = doubles(N_RUNS * m->n_states), *band = doubles(m->n_outputs);
    double *states = doubles(N_TIMES * m->n_states), *outputs = doubles(N_TIMES * m->n_outputs);
    double *figures = doubles(N_RUNS * m->n_outputs * HC_N_FIGURES), reached;
    int status[N_RUNS];
    for (int i = 0; i < N_TIMES; i++)
        times[i] = 0.05 * i;
    for (int i = 0; i < N_TIMES * m->n_inputs; i++)
        u[i] = i / 40 % 3 - 1;
    for (int i = 0; i < N_RUNS * m->n_parameters && argc > 1; i++)
        p[i] = atof(argv[1 + i % m->n_parameters % (argc - 1)]);
    for (int i = 0; i < N_RUNS * m->n_states; i++)
        x[i] = 0.1 * (i % 4);
    for (int method = HC_DORMAND_PRINCE; method <= HC_DOP853; method++) {
        hc_options options = {0, 1e-6, 1e-8, 0.0, 0, NULL};
        long counts[4];
        options.method = method;
        options.step = method == HC_RK4 ? 0.013 : 0.0;
        const double *inputs = m->n_inputs ? u : NULL;
        printf("%d ", hc_sweep_part(m, NULL, LANES, &options, times, N_TIMES, N_RUNS, x, inputs, p, 2.0, band, figures,
                                    final, status));
        printf("%d %d %d ", status[0], status[1], status[2]);
        printf("%d ", hc_simulate(m, &options, times, N_TIMES, x, inputs, p, states, outputs, &reached));
        hc_solver *solver = hc_solver_new(m, &options);
        if (!solver)
            return 3;
        printf("%d ", hc_solver_set(solver, 0.0, x, u, p));
        for (int i = 1; i < 20; i++) {
            printf("%d", hc_solver_advance(solver, 0.37 * i));
            printf("%d", hc_solver_set(solver, 0.37 * i, NULL, u + i * m->n_inputs, NULL));
        }
        hc_solver_counts(solver, counts);
        printf(" %ld\n", counts[0]);
        hc_solver_free(solver);
    }
    free(times), free(u), free(p), free(x), free(final), free(band), free(states), free(outputs), free(figures);
    return 0;
}
