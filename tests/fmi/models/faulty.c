/* x' = u - k x, with a fault once t >= at: 1 NaN, 2 a crash, 3 a hang, 4 an error, 5 an exit of the process. */

#define TOKEN "{faulty}"
enum { TIME, STATE, RATE, K, INPUT, FAULT, AT, N };
enum { NX = 1, NZ = 0 };
#define KINDS "txyauff"
#define STEP 0.01
#include "frame.h"

static const double START[N] = {0, 1, 0, 1, 0, 0, 0.3};
static const unsigned X[NX] = {STATE}, R[NX] = {RATE};

static void rates(model *m)
{
    m->v[RATE] = m->v[INPUT] - m->v[K] * m->v[STATE];
    if (m->v[TIME] < m->v[AT] - 1e-9 || m->v[FAULT] == 0.0) return;
    switch ((int)m->v[FAULT]) {
    case 1: m->v[RATE] = NAN; break;
    case 2: abort();
    case 3: for (volatile int more = 1; more;) {} break;
    case 4: m->mode = TERMINATED; break; /* the next call is refused */
    case 5: exit(7);
    }
}

static void zeros(const model *m, double *z) { (void)m, (void)z; }

static void update(model *m) { (void)m; }
