/* Private to the runtime: shared declarations of the solver's files. Between two calls x, f are the current states and
 * derivatives, x0, f0 those at the start of the last step.
 */
#ifndef HC_SOLVER_INTERNAL_H
#define HC_SOLVER_INTERNAL_H

#include "hc_steps.h"
#include "hc_ticks.h"

#define HC_MOST_STAGES 14 /* arrays of derivatives, besides those at both ends of a step */
#define HC_MOST_DENSE 8   /* coefficients of an interpolant */
#define HC_SAMPLES 5 /* points of a step at which sticking is checked, both ends included */

struct hc_solver {
    const hc_model_type *model;
    int n, n_held, n_friction, method; /* n: continuous states; held states follow them */
    int n_mean;                /* states in the mean error: more than n if the model is a part of a system */
    double rtol, longest;
    long max_steps, steps;
    double t, *x, *f;          /* now; f is valid if `fresh` */
    double earliest, latest;   /* the model is evaluated only between two switches, both included */
    double next_switch;
    double t0, *x0, *f0;       /* at the start of the last step */
    double length;             /* of the last step, before an event shortened it */
    double h, log_error;       /* length to try next (0: unknown); logarithm of the last squared error */
    int n_k, n_dense;          /* arrays in k and in dense, by the method */
    double *k[HC_MOST_STAGES]; /* derivatives of the stages after the first */
    double *stage;             /* one stage's states */
    double *dense[HC_MOST_DENSE]; /* coefficients of the interpolant, valid if `has_dense` */
    double *absolute, *u, *p;  /* atol * nominal; inputs; parameters */
    double *a, *b, *theta;     /* frictions, and the theta of each one's event */
    double t_event;
    int *mode, *mode0, fresh, has_dense, events_here;
    int f_open;                /* f at the end of the last step is not computed (RK4) */
    int short_steps;           /* steps that are shortened much may be of order 3 */
    int cubic;                 /* the last step was of order 3 */
    hc_ticks ticks;
    int started;               /* hc_solver_set was called */
    double quiet_from;         /* ticks from this time on are not executed */
    long counts[4];
};

enum { HC_RIGHT_HAND_SIDES = 0, HC_ACCEPTED = 1, HC_REJECTED = 2, HC_EVENTS = 3 };

/* Time for the model: not past a switch that the step does not cross, neither by rounding nor in its last stage. */
static inline double hc_model_time(const hc_solver *s, double t)
{
    return t < s->earliest ? s->earliest : t > s->latest ? s->latest : t;
}

static inline void hc_right_hand_side(hc_solver *s, double t, const double *x, double *dx)
{
    s->counts[HC_RIGHT_HAND_SIDES]++;
    s->model->derivatives(hc_model_time(s, t), x, s->u, s->p, s->mode, dx);
}

/* State i inside the last step, with q = 1 - theta:
 * c0 + theta (c1 + q (c2 + theta (c3 + q (c4 + theta (c5 + q (c6 + theta c7)))))) */
static inline double hc_interpolate_one(const hc_solver *s, int i, double theta)
{
    double *const *c = s->dense;
    const double rest = 1.0 - theta;
    double last = c[4][i];
    if (s->n_dense > 5)
        last += theta * (c[5][i] + rest * (c[6][i] + theta * c[7][i]));
    return c[0][i] + theta * (c[1][i] + rest * (c[2][i] + theta * (c[3][i] + rest * last)));
}

/* Inside the last step: theta = 0 at its start, 1 at its end. Needs hc_make_dense if has_dense is 0. */
void hc_make_dense(hc_solver *s);
void hc_interpolate(const hc_solver *s, double theta, double *x);

/* Fill theta with the friction events within the step; 0 if the step is too long to find them. */
int hc_look_for_events(hc_solver *s);
/* Shorten the step to the first event that hc_look_for_events found, and change modes. */
int hc_pass_events(hc_solver *s);

#endif
