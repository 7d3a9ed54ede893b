/* Van der Pol's oscillator: x' = v, v' = mu (1 - x^2) v - x. It gives directional derivatives. */

#define TOKEN "{van-der-pol}"
enum { TIME, POSITION, SPEED, POSITION_RATE, SPEED_RATE, MU, N };
enum { NX = 2, NZ = 0 };
#define KINDS "txxyya"
#define STEP 0.001
#define PARTIALS
#include "frame.h"

static const double START[N] = {0, 2, 0, 0, 0, 1};
static const unsigned X[NX] = {POSITION, SPEED}, R[NX] = {POSITION_RATE, SPEED_RATE};

static void rates(model *m)
{
    const double x = m->v[POSITION], v = m->v[SPEED];
    m->v[POSITION_RATE] = v;
    m->v[SPEED_RATE] = m->v[MU] * (1.0 - x * x) * v - x;
}

static void zeros(const model *m, double *z) { (void)m, (void)z; }

static void update(model *m) { (void)m; }

static void partials(const model *m, const double *given, double *found)
{
    const double x = m->v[POSITION], v = m->v[SPEED], mu = m->v[MU];
    const double dx = given[POSITION], dv = given[SPEED], dmu = given[MU];
    found[POSITION] = dx;
    found[SPEED] = dv;
    found[POSITION_RATE] = dv;
    found[SPEED_RATE] = -(2.0 * mu * x * v + 1.0) * dx + mu * (1.0 - x * x) * dv + (1.0 - x * x) * v * dmu;
}
