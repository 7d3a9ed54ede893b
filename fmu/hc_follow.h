/* States driven by given signals, such as lags of commands: exponential Rosenbrock steps, exact for states that are
 * linear in themselves, and stable for any time constant.
 */
#ifndef HC_FOLLOW_H
#define HC_FOLLOW_H

/* Derivatives of the followers, then the partial derivative of each by itself. */
typedef void (*hc_follow_rates)(double t, const double *state, const double *input, const double *param, const int *mode,
                                double *dx);

typedef struct {
    int n_states, n_inputs, n_followers;
    long steps, windows;
    const int *followers;    /* indices among the states */
    const double *time;      /* (steps, windows): at which the signals are given */
    const double *step;      /* (steps, windows) */
    const double *states;    /* (n_states, steps, windows); those of followers are not read */
    const double *inputs;    /* (n_inputs, steps, windows) */
    const double *parameters;
    double *values;          /* (n_followers, steps + 1, windows): from zero */
} hc_follow;

/* Windows from `from` to before `to`; 1 if there is no memory. */
int hc_follow_run(const hc_follow *follow, hc_follow_rates rates, long from, long to);

#endif
