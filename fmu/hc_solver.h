/* Integration of a model with dry friction: adaptive Dormand-Prince 5(4) or 8(5,3) with dense output and located
 * events, or classical Runge-Kutta in fixed steps. Steps end at switches at given times, and at ticks. No allocation
 * after hc_solver_new; one solver belongs to one thread.
 */
#ifndef HC_SOLVER_H
#define HC_SOLVER_H

#include <stddef.h>

#include "hc_model.h"

enum { HC_DORMAND_PRINCE = 0, HC_RK4 = 1, HC_DOP853 = 2 };

enum {
    HC_OK = 0,
    HC_NO_MEMORY = 1,
    HC_NOT_FINITE = 2,     /* a derivative is NaN or infinite */
    HC_STEP_TOO_SMALL = 3, /* the tolerance cannot be met */
    HC_TOO_MANY_STEPS = 4
};

typedef struct {
    int method;      /* HC_DORMAND_PRINCE, HC_RK4 or HC_DOP853 */
    double rtol;     /* relative tolerance (not RK4) */
    double atol;     /* absolute tolerance, times the nominal size of each state where `nominal` is given */
    double step;     /* fixed step (RK4), or longest step (the others; 0: no limit) */
    long max_steps;  /* in one call; 0: no limit */
    const double *nominal; /* n_states sizes, or NULL for 1 */
} hc_options;

typedef struct hc_solver hc_solver;

/* NULL if there is no memory. The model must outlive the solver. */
hc_solver *hc_solver_new(const hc_model_type *model, const hc_options *options);
void hc_solver_free(hc_solver *solver);

/* Change the tolerances, as in hc_options. */
void hc_solver_tolerance(hc_solver *solver, double rtol, double atol, const double *nominal);

/* Set time, states, inputs and parameters (all copied) and find the friction modes: a velocity of exactly zero sticks
 * if it can. To be called also when inputs or parameters jump: modes are found again, the step size is kept. NULL
 * leaves an array unchanged. Ticks due at t are executed; if neither t nor x is new, those executed at t are repeated with the
 * new inputs. */
int hc_solver_set(hc_solver *solver, double t, const double *x, const double *u, const double *p);

/* Integrate to time `until`, inputs held. On an error the solver stays at the time it reached. */
int hc_solver_advance(hc_solver *solver, double until);

double hc_solver_time(const hc_solver *solver);
/* Both valid until the next call that changes the solver. */
const double *hc_solver_states(const hc_solver *solver);
const int *hc_solver_modes(const hc_solver *solver);
/* right-hand sides evaluated, steps accepted, steps rejected, events located, since hc_solver_new */
void hc_solver_counts(const hc_solver *solver, long counts[4]);

/* The whole state as hc_solver_size numbers; a solver of the same model that loads it continues bit for bit. */
size_t hc_solver_size(const hc_solver *solver);
void hc_solver_save(const hc_solver *solver, double *into);
void hc_solver_load(hc_solver *solver, const double *from);

#endif
