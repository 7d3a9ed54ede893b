/* Two sampled functions and a lag in one FMU, by two clocks.

   Clock 1, every 0.1 s, a PI controller:        y = kp e + s,  then s becomes s + ki 0.1 e.
   Clock 2, every 0.25 s from 0.05 s on, a count: n becomes n + w.
   In between, by Euler's method with 1 ms:       z' = u - z. */

#define TOKEN "{clocked}"
enum { TIME, E, Y, KP, KI, SUM, W, COUNT, U, Z, RATE, SO_FAR, N };
enum { FIRST = 20, SECOND = 21 };
enum { NX = 1, NZ = 0 };
#define KINDS "t1Affy2Buxyy"
#define STEP 0.001
#define CLOCKS
#include "frame.h"

static const double START[N] = {0, 0, 0, 2, 0.5, 0, 1, 0, 0, 0, 0, 0};
static const unsigned X[NX] = {Z}, R[NX] = {RATE};

static void rates(model *m)
{
    m->v[RATE] = m->v[U] - m->v[Z];
    if (m->active & 1) m->v[Y] = m->v[KP] * m->v[E] + m->v[SUM];
    if (m->active & 2) m->v[COUNT] = m->v[SO_FAR] + m->v[W];
}

static void zeros(const model *m, double *z) { (void)m, (void)z; }

static void update(model *m)
{
    if (m->active & 1) m->v[SUM] += m->v[KI] * 0.1 * m->v[E];
    if (m->active & 2) m->v[SO_FAR] += m->v[W];
}

fmi3Status fmi3SetClock(fmi3Instance instance, const fmi3ValueReference of[], size_t n, const fmi3Clock values[])
{
    IN(EVENT, "fmi3SetClock");
    for (size_t i = 0; i < n; i++) {
        if (of[i] != FIRST && of[i] != SECOND) return refused(m, "fmi3SetClock: not a clock");
        const unsigned bit = of[i] == FIRST ? 1u : 2u;
        m->active = values[i] ? m->active | bit : m->active & ~bit;
    }
    return fmi3OK;
}

fmi3Status fmi3EnterStepMode(fmi3Instance instance)
{
    IN(m->events ? EVENT : 0, "fmi3EnterStepMode");
    if (m->active) return refused(m, "fmi3EnterStepMode: a clock is active");
    m->mode = STEPPING;
    return fmi3OK;
}
