/* Dahlquist's test equation with an input: x' = u - k x. In Co-Simulation its step is 0.1 s. */

#define TOKEN "{dahlquist}"
enum { TIME, STATE, RATE, K, INPUT, N };
enum { NX = 1, NZ = 0 };
#define KINDS "txyau"
#define STEP 0.1
#include "frame.h"

static const double START[N] = {0, 1, 0, 1, 0};
static const unsigned X[NX] = {STATE}, R[NX] = {RATE};

static void rates(model *m) { m->v[RATE] = m->v[INPUT] - m->v[K] * m->v[STATE]; }

static void zeros(const model *m, double *z) { (void)m, (void)z; }

static void update(model *m) { (void)m; }
