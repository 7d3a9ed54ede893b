/* Windows of hc_model_lanes with their slopes, for a run under the sanitisers: a last pack that is not full, a state that
 * is given, parameters from the command line of which two share a column. Prints the last row and its slopes. */
#include "hc_shoot.h"

#include <stdio.h>
#include <stdlib.h>

enum { WINDOWS = 11, ROWS = 3, PIECES = 2, GIVEN = 3 };

static double *doubles(long n)
{
    double *array = calloc((size_t)n, sizeof *array); /* no spare room: the sanitiser sees one element too far */
    if (!array)
        exit(3);
    return array;
}

int main(int argc, char **argv)
{
    const int states = atoi(argv[1]), inputs = atoi(argv[2]), parameters = argc - 3, known = GIVEN;
    const int columns = states + 1;
    const long steps = PIECES * (ROWS - 1) * WINDOWS;
    double *time = doubles(steps), *step = doubles(steps), *u = doubles(inputs * steps), *values = doubles(steps);
    double *p = doubles(parameters), *x = doubles(ROWS * states * WINDOWS), *slopes = doubles(states * columns * WINDOWS);
    int *of_state = calloc((size_t)states, sizeof *of_state);
    int *of_parameter = calloc((size_t)parameters, sizeof *of_parameter);
    if (!of_state || !of_parameter)
        return 3;
    for (long i = 0; i < steps; i++) {
        step[i] = 0.01 + 0.001 * (double)(i % 5);
        values[i] = 0.05 * (double)(i % 7);
    }
    for (long i = 0; i < inputs * steps; i++)
        u[i] = 0.1 * (double)(i % 9);
    for (long i = 0; i < states * WINDOWS; i++)
        x[i] = 0.1 * (double)(i % 8) - 0.3;
    for (int i = 0; i < states; i++)
        of_state[i] = i;
    for (int i = 0; i < parameters; i++) {
        p[i] = atof(argv[3 + i]);
        of_parameter[i] = i < 2 ? states : -1;
    }
    const hc_shoot shoot = {states, inputs, parameters, 1, columns, 0, WINDOWS, ROWS, PIECES, &known, time, step, u, values,
                            p, x, slopes, of_state, of_parameter};
    if (!hc_model_lanes) /* vectors gain nothing here */
        return 0;
    if (hc_shoot_run(&shoot, hc_model_lanes, &hc_model_slopes, 0, 8) ||
        hc_shoot_run(&shoot, hc_model_lanes, &hc_model_slopes, 8, WINDOWS))
        return 3;
    for (long i = 0; i < states * WINDOWS; i++)
        printf("%.17g ", x[(ROWS - 1) * states * WINDOWS + i]);
    for (long i = 0; i < states * columns * WINDOWS; i++)
        printf("%.17g ", slopes[i]);
    free(time), free(step), free(u), free(values), free(p), free(x), free(slopes), free(of_state), free(of_parameter);
    return 0;
}
