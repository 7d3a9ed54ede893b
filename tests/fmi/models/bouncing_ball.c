/* A ball on a floor: h' = v, v' = -g; at h = 0 the speed becomes -e v. Below 0.1 m/s the ball stays on the floor. */

#define TOKEN "{bouncing-ball}"
enum { TIME, HEIGHT, SPEED, HEIGHT_RATE, SPEED_RATE, G, E, LEAST, RESTING, N };
enum { NX = 2, NZ = 1 };
#define KINDS "txxyyfafy"
#define STEP 0.001
#include "frame.h"
#include <float.h>

static const double START[N] = {0, 1, 0, 0, 0, 9.81, 0.7, 0.1, 0};
static const unsigned X[NX] = {HEIGHT, SPEED}, R[NX] = {HEIGHT_RATE, SPEED_RATE};

static void rates(model *m)
{
    m->v[HEIGHT_RATE] = m->v[SPEED];
    m->v[SPEED_RATE] = m->v[RESTING] ? 0.0 : -m->v[G];
}

static void zeros(const model *m, double *z) { z[0] = m->v[RESTING] ? 1.0 : m->v[HEIGHT]; }

static void update(model *m)
{
    if (m->v[RESTING] || m->v[HEIGHT] > 0.0 || m->v[SPEED] >= 0.0) return;
    m->v[HEIGHT] = DBL_MIN; /* an indicator that is positive */
    m->v[SPEED] *= -m->v[E];
    if (m->v[SPEED] < m->v[LEAST]) {
        m->v[SPEED] = 0.0;
        m->v[RESTING] = 1.0;
    }
}
