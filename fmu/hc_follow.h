/* States that follow from signals that are given: stepped by the exponential of their own slope (Rosenbrock), exact
 * where they are linear in themselves and stable however fast they are.
 */
#ifndef HC_FOLLOW_H
#define HC_FOLLOW_H

/* Rates of the followers, and behind these the slope of each by itself. */
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
