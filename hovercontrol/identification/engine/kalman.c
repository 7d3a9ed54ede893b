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

/* Arrays of System, Filtered and Smoothed; `half` to `Z` may be NULL in a filter run. */
typedef struct {
    long rows, stretches, columns;
    const double *A, *Q, *drive, *H, *R, *seen, *P0;
    double *white, *log_det, *half, *back, *P, *Z;
    const double *weights;
    double *state, *covariance, *push, *information;
} kalman;

static void measure(const kalman *s, size_t at, row *P, double *Z, int *bad)
{
    const long m = s->columns;
    double halves[C][N], backs[C][N];
    for (int c = 0; c < C; c++) {
        const double *h = s->H + (at * C + c) * N, *seen = s->seen + (at * C + c) * m;
        double *white = s->white + (at * C + c) * m, F = s->R[at * C + c], root;
        row Ph = {0};
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
        s->log_det[at * C + c] = log(F);
        memcpy(white, seen, (size_t)m * sizeof *white);
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
        if (!s->half)
            continue;
        memcpy(halves[c], Ph, sizeof halves[c]);
        memcpy(backs[c], h, sizeof backs[c]);
        for (int d = 0; d < c; d++) {
            double both = 0.0;
            for (int i = 0; i < N; i++)
                both += h[i] * halves[d][i];
            for (int i = 0; i < N; i++)
                backs[c][i] -= both * backs[d][i];
        }
        for (int i = 0; i < N; i++)
            backs[c][i] /= root;
    }
    if (s->half) {
        memcpy(s->half + at * C * N, halves, sizeof halves);
        memcpy(s->back + at * C * N, backs, sizeof backs);
    }
}

static void predict(const kalman *s, size_t at, row *P, double *Z, double *ahead)
{
    const long m = s->columns;
    const double *A = s->A + at * N * N, *Q = s->Q + at * N * N;
    row T[N], U[N];
    memcpy(ahead, s->drive + at * N * m, (size_t)(N * m) * sizeof *ahead);
    for (int i = 0; i < N; i++) {
        memset(T[i], 0, sizeof T[i]);
        for (int k = 0; k < N; k++) {
            const double a = A[i * N + k];
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
            const double a = A[i * N + k];
            if (a == 0.0)
                continue;
            for (int j = 0; j < PAD; j++)
                P[i][j] += a * U[k][j];
        }
    }
    for (int i = 0; i < N; i++)
        for (int j = 0; j <= i; j++)
            P[i][j] = P[j][i] = 0.5 * (P[i][j] + P[j][i] + Q[i * N + j] + Q[j * N + i]);
}

/* Filter a chain of stretches, each of which begins where the one before ends; 1: a covariance is not positive, 2: no memory. */
EXPORT int kalman_filter(const kalman *s, long from, long to)
{
    const long m = s->columns;
    double *Z = calloc((size_t)(2 * N * m + 1), sizeof *Z);
    row P[N] = {{0}};
    int bad = 0;
    if (!Z)
        return 2;
    for (int i = 0; i < N; i++)
        memcpy(P[i], s->P0 + ((size_t)from * N + (size_t)i) * N, N * sizeof(double));
    for (long w = from; w < to && !bad; w++) {
        for (long k = 0; k < s->rows && !bad; k++) {
            const size_t at = (size_t)(k * s->stretches + w);
            if (s->half) {
                for (int i = 0; i < N; i++)
                    memcpy(s->P + (at * N + (size_t)i) * N, P[i], N * sizeof(double));
                memcpy(s->Z + at * N * (size_t)m, Z, (size_t)(N * m) * sizeof *Z);
            }
            measure(s, at, P, Z, &bad);
            if (k < s->rows - 1 && !bad)
                predict(s, at, P, Z, Z + N * m);
        }
    }
    free(Z);
    return bad;
}

/* X <- A' X A, r <- A' r; rows of A are `width` apart. */
static void step_back(const double *A, int width, double *r, row *X)
{
    row T[N];
    double next[N] = {0};
    memset(T, 0, sizeof T);
    for (int k = 0; k < N; k++)
        for (int i = 0; i < N; i++) {
            const double a = A[k * width + i];
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
            const double a = A[k * width + i];
            if (a == 0.0)
                continue;
            for (int j = 0; j < PAD; j++)
                X[i][j] += a * T[k][j];
        }
}

/* X <- J' X J + back' back, r <- J' r + back' e with J = I - half' back. (The expanded form is not stable.) */
static void take_in(const double *half, const double *back, const double *e, double *r, row *X)
{
    row J[N];
    memset(J, 0, sizeof J);
    for (int i = 0; i < N; i++) {
        J[i][i] = 1.0;
        for (int c = 0; c < C; c++)
            for (int j = 0; j < N; j++)
                J[i][j] -= half[c * N + i] * back[c * N + j];
    }
    step_back(J[0], PAD, r, X);
    for (int c = 0; c < C; c++)
        for (int i = 0; i < N; i++) {
            const double b = back[c * N + i];
            if (b == 0.0)
                continue;
            r[i] += b * e[c];
            for (int j = 0; j < N; j++)
                X[i][j] += b * back[c * N + j];
        }
}

/* Smooth a chain of stretches after a filter run that stored all arrays. */
EXPORT int kalman_smoother(const kalman *s, long from, long to)
{
    const long m = s->columns;
    double r[N] = {0};
    row X[N] = {{0}};
    for (long w = to - 1; w >= from; w--) {
        const double *weights = s->weights + w * m;
        for (long k = s->rows - 1; k >= 0; k--) {
            const size_t at = (size_t)(k * s->stretches + w);
            const double *white = s->white + at * C * (size_t)m, *Z = s->Z + at * N * (size_t)m;
            const double *P = s->P + at * N * N;
            double e[C] = {0}, z[N] = {0};
            row T[N];
            if (k < s->rows - 1) {
                memcpy(s->push + at * N, r, sizeof r);
                for (int i = 0; i < N; i++)
                    memcpy(s->information + (at * N + (size_t)i) * N, X[i], N * sizeof(double));
                step_back(s->A + at * N * N, N, r, X);
            }
            for (int c = 0; c < C; c++)
                for (long j = 0; j < m; j++)
                    e[c] += white[c * m + j] * weights[j];
            for (int i = 0; i < N; i++)
                for (long j = 0; j < m; j++)
                    z[i] += Z[i * m + j] * weights[j];
            take_in(s->half + at * C * N, s->back + at * C * N, e, r, X);
            for (int i = 0; i < N; i++) {
                memset(T[i], 0, sizeof T[i]);
                for (int l = 0; l < N; l++) {
                    z[i] += P[i * N + l] * r[l];
                    for (int j = 0; j < PAD; j++)
                        T[i][j] += P[i * N + l] * X[l][j];
                }
            }
            memcpy(s->state + at * N, z, sizeof z);
            for (int i = 0; i < N; i++) {
                double *V = s->covariance + (at * N + (size_t)i) * N;
                memcpy(V, P + i * N, N * sizeof *V);
                for (int l = 0; l < N; l++)
                    for (int j = 0; j < N; j++)
                        V[j] -= T[i][l] * P[l * N + j];
            }
        }
    }
    return 0;
}
