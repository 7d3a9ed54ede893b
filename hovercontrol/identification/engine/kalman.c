/* The filter and the smoother of kalman.py, chain by chain; sizes.h defines the numbers of states (N) and channels (C).
 *
 * Channels are processed one after the other, which is equivalent to whitening by the Cholesky factor of their
 * covariance.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sizes.h"

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { PAD = (N + 3) / 4 * 4 };

typedef double row[PAD];

enum { GROUPS = 4 };

/* System, Filtered and Smoothed of kalman.py. A system is given by the matrices of all N states, or (Q is NULL) by those
 * of its first `states`, which missing accelerations drive. Columns come in groups; NULL: zeros. If `weights` is not
 * NULL there is one column, their sum with these weights. `white` and `log_det` may be NULL. */
typedef struct {
    long rows, stretches, columns, groups, states, width, driven, sampled;
    long count[GROUPS];
    long drive_strides[GROUPS][2], seen_strides[GROUPS][2]; /* from state or channel to the next, from column to the next */
    const double *drive[GROUPS], *seen[GROUPS];
    const double *A, *Q, *H, *R, *P0, *moments;
    const long *of; /* driven states */
    double *products, *log_dets, *P, *Z, *white, *log_det;
    const double *weights;
    double *state, *variance, *known, *forces;
} kalman;

/* What the smoother needs of a row. */
typedef struct {
    row P[N], A[N];
    double z[N], white[C], half[C][N], back[C][N];
} kept;

/* What an acceleration held over a step changes at its end: of a sampled model the next value, else (A + I) e / 2. */
static void gamma_of(const kalman *s, const row *A, int j, double *g)
{
    const long d = s->of[j];
    for (int i = 0; i < s->states; i++)
        g[i] = s->sampled ? (i == d) : 0.5 * A[i][d] + (i == d ? 0.5 : 0.0);
}

/* Moments of the missing acceleration j over a step: see noise.py. */
static double moment(const kalman *s, size_t at, int which, int j)
{
    const size_t steps = (size_t)((s->rows - 1) * s->stretches);
    return s->moments[((size_t)which * steps + at) * (size_t)s->driven + (size_t)j];
}

/* The transition matrix of a step and, unless NULL, the covariance of its noise. */
static void step_of(const kalman *s, size_t at, row *A, row *Q)
{
    const long n = s->states, width = s->width;
    double g[N];
    memset(A, 0, N * sizeof *A);
    for (long i = 0; i < width; i++)
        memcpy(A[i], s->A + (at * (size_t)width + (size_t)i) * (size_t)width, (size_t)width * sizeof(double));
    if (s->Q) {
        for (int i = 0; i < N && Q; i++)
            memcpy(Q[i], s->Q + (at * N + (size_t)i) * N, N * sizeof(double));
        return;
    }
    if (Q)
        memset(Q, 0, N * sizeof *Q);
    for (int j = 0; j < s->driven; j++) {
        const double held = moment(s, at, 1, j), pushed = moment(s, at, 2, j), both = moment(s, at, 3, j);
        gamma_of(s, A, j, g);
        A[n + j][n + j] = moment(s, at, 0, j);
        for (long i = 0; i < n; i++) {
            A[i][n + j] = g[i] * held;
            if (!Q || g[i] == 0.0)
                continue;
            Q[i][n + j] = Q[n + j][i] = g[i] * both;
            for (long l = 0; l < n; l++)
                Q[i][l] += g[i] * pushed * g[l];
        }
        if (Q)
            Q[n + j][n + j] = moment(s, at, 4, j);
    }
}

/* All columns of a state or channel at a row, from their groups. */
static void gather(const kalman *s, const double *const *from, const long (*strides)[2], size_t at, double *into)
{
    const double *weights = s->weights;
    if (weights)
        *into = 0.0;
    for (long g = 0; g < s->groups; g++) {
        const double *own = from[g] ? from[g] + at * (size_t)strides[g][0] : NULL;
        for (long j = 0; j < s->count[g]; j++) {
            const double value = own ? own[j * strides[g][1]] : 0.0;
            if (weights)
                *into += *weights++ * value;
            else
                *into++ = value;
        }
    }
}

static void measure(const kalman *s, size_t at, row *P, double *Z, double *whites, double *log_det, kept *keep, int *bad)
{
    const long m = s->columns;
    for (int c = 0; c < C; c++) {
        double *white = whites + c * m, F = s->R[at * C + c], root, h[N] = {0};
        row Ph = {0};
        memcpy(h, s->H + (at * C + c) * (size_t)s->width, (size_t)s->width * sizeof *h);
        for (int i = 0; i < N; i++)
            if (h[i] != 0.0)
                for (int j = 0; j < PAD; j++)
                    Ph[j] += h[i] * P[i][j];
        for (int i = 0; i < N; i++)
            F += h[i] * Ph[i];
        if (!(F > 0.0)) {
            *bad = 1;
            return;
        }
        root = sqrt(F);
        log_det[c] = log(F);
        gather(s, s->seen, s->seen_strides, at * C + (size_t)c, white);
        for (int i = 0; i < N; i++)
            if (h[i] != 0.0)
                for (long j = 0; j < m; j++)
                    white[j] -= h[i] * Z[i * m + j];
        for (long j = 0; j < m; j++)
            white[j] /= root;
        for (int j = 0; j < PAD; j++)
            Ph[j] /= root;
        for (int i = 0; i < N; i++) {
            if (Ph[i] == 0.0)
                continue;
            for (long j = 0; j < m; j++)
                Z[i * m + j] += Ph[i] * white[j];
            for (int j = 0; j < PAD; j++)
                P[i][j] -= Ph[i] * Ph[j];
        }
        if (!keep)
            continue;
        memcpy(keep->half[c], Ph, sizeof keep->half[c]);
        memcpy(keep->back[c], h, sizeof keep->back[c]);
        for (int d = 0; d < c; d++) {
            double both = 0.0;
            for (int i = 0; i < N; i++)
                both += h[i] * keep->half[d][i];
            for (int i = 0; i < N; i++)
                keep->back[c][i] -= both * keep->back[d][i];
        }
        for (int i = 0; i < N; i++)
            keep->back[c][i] /= root;
    }
}

static void predict(const kalman *s, size_t at, row *A, row *P, double *Z, double *ahead)
{
    const long m = s->columns;
    row Q[N], T[N], U[N];
    step_of(s, at, A, Q);
    for (long i = 0; i < N; i++) {
        if (i < s->width)
            gather(s, s->drive, s->drive_strides, at * (size_t)s->width + (size_t)i, ahead + i * m);
        else
            memset(ahead + i * m, 0, (size_t)m * sizeof *ahead);
    }
    for (int i = 0; i < N; i++) {
        memset(T[i], 0, sizeof T[i]);
        for (int k = 0; k < N; k++) {
            const double a = A[i][k];
            if (a == 0.0)
                continue;
            for (int j = 0; j < PAD; j++)
                T[i][j] += a * P[k][j];
            for (long j = 0; j < m; j++)
                ahead[i * m + j] += a * Z[k * m + j];
        }
    }
    memcpy(Z, ahead, (size_t)(N * m) * sizeof *Z);
    for (int i = 0; i < N; i++) /* row i of A times T transposed: T[j] . A[i] */
        for (int j = 0; j < PAD; j++)
            U[i][j] = j < N ? T[j][i] : 0.0;
    for (int i = 0; i < N; i++) {
        memset(P[i], 0, sizeof P[i]);
        for (int k = 0; k < N; k++) {
            const double a = A[i][k];
            if (a == 0.0)
                continue;
            for (int j = 0; j < PAD; j++)
                P[i][j] += a * U[k][j];
        }
    }
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++)
            P[i][j] = P[j][i] = 0.5 * (P[i][j] + P[j][i] + Q[i][j] + Q[j][i]);
}

/* Add the inner products of a row's columns to the lower triangle. */
static void multiply(const double *restrict whites, long m, double *restrict products)
{
    for (long i = 0; i < m; i++) {
        double own[C], *to = products + i * m;
        for (int c = 0; c < C; c++)
            own[c] = whites[c * m + i];
        for (long j = 0; j <= i; j++) {
            double sum = to[j];
            for (int c = 0; c < C; c++)
                sum += own[c] * whites[c * m + j];
            to[j] = sum;
        }
    }
}

static int filter_chain(const kalman *s, long from, long to, double *Z)
{
    const long m = s->columns;
    double *ahead = Z + N * m, *whites = ahead + N * m, log_det[C];
    row P[N] = {{0}}, A[N];
    int bad = 0;
    memset(Z, 0, (size_t)(N * m) * sizeof *Z);
    for (int i = 0; i < N; i++)
        memcpy(P[i], s->P0 + ((size_t)from * N + (size_t)i) * N, N * sizeof(double));
    for (long w = from; w < to; w++) {
        double *products = s->products + w * m * m;
        for (int i = 0; i < N; i++)
            memcpy(s->P + (w * N + i) * N, P[i], N * sizeof(double));
        memcpy(s->Z + w * N * m, Z, (size_t)(N * m) * sizeof *Z);
        for (long k = 0; k < s->rows; k++) {
            const size_t at = (size_t)(k * s->stretches + w);
            measure(s, at, P, Z, whites, log_det, NULL, &bad);
            if (bad)
                return bad;
            multiply(whites, m, products);
            for (int c = 0; c < C; c++)
                s->log_dets[w] += log_det[c];
            if (s->white) {
                memcpy(s->white + at * C * (size_t)m, whites, (size_t)(C * m) * sizeof *whites);
                memcpy(s->log_det + at * C, log_det, sizeof log_det);
            }
            if (k < s->rows - 1)
                predict(s, at, A, P, Z, ahead);
        }
        for (long i = 0; i < m; i++)
            for (long j = 0; j < i; j++)
                products[j * m + i] = products[i * m + j];
    }
    return 0;
}

/* Filter chains of stretches, each of which begins where the one before ends; 1: a covariance is not positive, 2: no memory.
 */
EXPORT int kalman_filter(const kalman *s, const long *chains, long count)
{
    double *Z = malloc((size_t)((2 * N + C) * s->columns + 1) * sizeof *Z);
    int bad = Z ? 0 : 2;
    for (long i = 0; i < count && !bad; i++)
        bad = filter_chain(s, chains[i], chains[i + 1], Z);
    free(Z);
    return bad;
}

/* X <- A' X A, r <- A' r. */
static void step_back(const row *A, double *r, row *X)
{
    row T[N];
    double next[N] = {0};
    memset(T, 0, sizeof T);
    for (int k = 0; k < N; k++)
        for (int i = 0; i < N; i++) {
            const double a = A[k][i];
            if (a == 0.0)
                continue;
            next[i] += a * r[k];
            for (int j = 0; j < PAD; j++)
                T[i][j] += a * X[k][j];
        }
    memcpy(r, next, sizeof next);
    for (int i = 0; i < N; i++) { /* T <- T transposed */
        for (int j = 0; j < i; j++) {
            const double t = T[i][j];
            T[i][j] = T[j][i];
            T[j][i] = t;
        }
        memset(X[i], 0, sizeof X[i]);
    }
    for (int k = 0; k < N; k++)
        for (int i = 0; i < N; i++) {
            const double a = A[k][i];
            if (a == 0.0)
                continue;
            for (int j = 0; j < PAD; j++)
                X[i][j] += a * T[k][j];
        }
}

/* X <- J' X J + back' back, r <- J' r + back' e with J = I - half' back. (The expanded form is not stable.) */
static void take_in(const kept *at, double *r, row *X)
{
    row J[N];
    memset(J, 0, sizeof J);
    for (int i = 0; i < N; i++) {
        J[i][i] = 1.0;
        for (int c = 0; c < C; c++)
            for (int j = 0; j < N; j++)
                J[i][j] -= at->half[c][i] * at->back[c][j];
    }
    step_back(J, r, X);
    for (int c = 0; c < C; c++)
        for (int i = 0; i < N; i++) {
            const double b = at->back[c][i];
            if (b == 0.0)
                continue;
            r[i] += b * at->white[c];
            for (int j = 0; j < N; j++)
                X[i][j] += b * at->back[c][j];
        }
}

/* Sums for the size of each missing acceleration: of r' Q_j r and tr(Q_j N), Q_j its share of Q. */
static void force_sums(const kalman *s, size_t at, const row *A, const double *r, const row *X, double *sums)
{
    const long n = s->states;
    double g[N];
    for (int j = 0; j < s->driven; j++) {
        const double pushed = moment(s, at, 2, j), both = moment(s, at, 3, j), own = moment(s, at, 4, j);
        const double last = r[n + j];
        double along = 0.0, square = 0.0, cross = 0.0;
        gamma_of(s, A, j, g);
        for (long i = 0; i < n; i++) {
            double Xg = 0.0;
            if (g[i] == 0.0)
                continue;
            for (long l = 0; l < n; l++)
                Xg += X[i][l] * g[l];
            along += r[i] * g[i];
            square += g[i] * Xg;
            cross += X[n + j][i] * g[i];
        }
        sums[2 * j] += pushed * along * along + 2.0 * both * along * last + own * last * last;
        sums[2 * j + 1] += pushed * square + 2.0 * both * cross + own * X[n + j][n + j];
    }
}

/* State, its variances, and those of the channels at a row: x = z + P r, V = P - P X P. */
static void smoothed(const kalman *s, size_t at, const kept *own, const double *r, const row *X)
{
    const row *P = own->P;
    row T[N];
    for (int i = 0; i < N; i++) {
        double z = own->z[i], V = P[i][i];
        memset(T[i], 0, sizeof T[i]);
        for (int l = 0; l < N; l++) {
            z += P[i][l] * r[l];
            for (int j = 0; j < PAD; j++)
                T[i][j] += P[i][l] * X[l][j];
        }
        for (int l = 0; l < N; l++)
            V -= T[i][l] * P[i][l];
        s->state[at * N + (size_t)i] = z;
        s->variance[at * N + (size_t)i] = V;
    }
    for (int c = 0; c < C; c++) {
        const double *h = s->H + (at * C + (size_t)c) * (size_t)s->width;
        double known = 0.0;
        for (long i = 0; i < s->width; i++)
            for (long l = 0; l < s->width && h[i] != 0.0; l++) {
                double V = P[i][l];
                if (h[l] == 0.0)
                    continue;
                for (int j = 0; j < N; j++)
                    V -= T[i][j] * P[l][j];
                known += h[i] * V * h[l];
            }
        s->known[at * C + (size_t)c] = known;
    }
}

/* Filter a stretch again from where it begins, one column; then smooth it from r and X at its end to those at its begin. */
static int smooth_stretch(const kalman *s, long w, kept *rows, double *r, row *X)
{
    const long m = s->columns;
    kalman one = *s;
    row P[N] = {{0}};
    double Z[N] = {0}, ahead[N], log_det[C];
    int bad = 0;
    one.weights = s->weights + w * m;
    one.columns = 1;
    for (int i = 0; i < N; i++) {
        memcpy(P[i], s->P + (w * N + i) * N, N * sizeof(double));
        for (long j = 0; j < m; j++)
            Z[i] += s->Z[(w * N + i) * m + j] * one.weights[j];
    }
    for (long k = 0; k < s->rows && !bad; k++) {
        const size_t at = (size_t)(k * s->stretches + w);
        memcpy(rows[k].P, P, sizeof P);
        memcpy(rows[k].z, Z, sizeof Z);
        measure(&one, at, P, Z, rows[k].white, log_det, rows + k, &bad);
        if (k < s->rows - 1)
            predict(&one, at, rows[k].A, P, Z, ahead);
    }
    for (long k = s->rows - 1; k >= 0 && !bad; k--) {
        const size_t at = (size_t)(k * s->stretches + w);
        if (k < s->rows - 1) {
            force_sums(s, at, rows[k].A, r, X, s->forces + 2 * w * s->driven);
            step_back(rows[k].A, r, X);
        }
        take_in(rows + k, r, X);
        smoothed(s, at, rows + k, r, X);
    }
    return bad;
}

/* Smooth chains of stretches after a filter run. */
EXPORT int kalman_smoother(const kalman *s, const long *chains, long count)
{
    kept *rows = malloc((size_t)s->rows * sizeof *rows);
    int bad = rows ? 0 : 2;
    for (long i = 0; i < count; i++) {
        double r[N] = {0};
        row X[N] = {{0}};
        for (long w = chains[i + 1] - 1; w >= chains[i] && !bad; w--)
            bad = smooth_stretch(s, w, rows, r, X);
    }
    free(rows);
    return bad;
}
