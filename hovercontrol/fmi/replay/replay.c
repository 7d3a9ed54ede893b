/* Runs of an FMU over the rows of a log: one call for all rows, so that no interpreter stands in between.

   Model Exchange: the classical Runge-Kutta method,
       k1 = f(t, x),  k2 = f(t + h/2, x + h/2 k1),  k3 = f(t + h/2, x + h/2 k2),  k4 = f(t + h, x + h k3),
       x(t + h) = x + h/6 (k1 + 2 k2 + 2 k3 + k4)
   (Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.1). A run stops before the step
   in which an event indicator changes its sign, or at which a time event is due.
   Co-Simulation: fmi2DoStep or fmi3DoStep. */

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { MOST_STATES = 512, MOST_INDICATORS = 512 };
enum { DONE = 0, EVENT = 1, REFUSED = 2, ENDED = 3 };

typedef struct {
    void *component;
    long fmi, states, inputs, outputs, indicators;
    int (*set_time)(void *, double);
    int (*set_states)(void *, const double *, size_t);
    int (*rates)(void *, double *, size_t);
    int (*indicate)(void *, double *, size_t);
    int (*set2)(void *, const uint32_t *, size_t, const double *);
    int (*get2)(void *, const uint32_t *, size_t, double *);
    int (*set3)(void *, const uint32_t *, size_t, const double *, size_t);
    int (*get3)(void *, const uint32_t *, size_t, double *, size_t);
    int (*complete2)(void *, int, int *, int *);
    int (*complete3)(void *, bool, bool *, bool *);
    int (*step2)(void *, double, double, int);
    int (*step3)(void *, double, double, bool, bool *, bool *, bool *, double *);
    const uint32_t *input_references, *output_references;
    size_t input_count, output_count;
    long rows, pieces;
    double fixed; /* step that steps must be multiples of, or 0 */
    double next;  /* time of the next time event */
    const double *time, *u; /* rows; rows x inputs, held from row to row */
    double *x, *y;          /* rows x states; rows x outputs */
    double *state;          /* the states at the place reached */
    long row, piece, status, what; /* where it stopped and why; the call refused */
    double reached;                /* the time there */
} hc_replay;

#define CALL(n, c) do { int s_ = (c); if (s_ > 1) { r->status = s_; r->what = n; return REFUSED; } } while (0)

static int set_inputs(hc_replay *r, long row)
{
    const double *u = r->u + row * r->inputs;
    if (!r->inputs) return 0;
    if (r->fmi == 2) return r->set2(r->component, r->input_references, r->input_count, u);
    return r->set3(r->component, r->input_references, r->input_count, u, (size_t)r->inputs);
}

static int get_outputs(hc_replay *r, long row)
{
    double *y = r->y + row * r->outputs;
    if (!r->outputs) return 0;
    if (r->fmi == 2) return r->get2(r->component, r->output_references, r->output_count, y);
    return r->get3(r->component, r->output_references, r->output_count, y, (size_t)r->outputs);
}

static int slope(hc_replay *r, double t, const double *x, double *k)
{
    int s = r->set_time(r->component, t);
    if (s > 1) return s;
    if ((s = r->set_states(r->component, x, (size_t)r->states)) > 1) return s;
    return r->rates(r->component, k, (size_t)r->states);
}

static int record(hc_replay *r, long row)
{
    CALL(1, r->set_time(r->component, r->time[row]));
    if (r->states) CALL(2, r->set_states(r->component, r->state, (size_t)r->states));
    CALL(3, set_inputs(r, row));
    CALL(5, get_outputs(r, row));
    memcpy(r->x + row * r->states, r->state, (size_t)r->states * sizeof(double));
    return DONE;
}

/* From r->row, r->piece with r->state, which holds there. */
EXPORT int hc_replay_continuous(hc_replay *r)
{
    double k1[MOST_STATES], k2[MOST_STATES], k3[MOST_STATES], k4[MOST_STATES], z[MOST_STATES];
    double before[MOST_INDICATORS], after[MOST_INDICATORS], *x = r->state;
    const long n = r->states, m = r->indicators;
    if (n > MOST_STATES || m > MOST_INDICATORS) return REFUSED;
    for (; r->row + 1 < r->rows; r->row++, r->piece = 0) {
        const double from = r->time[r->row], h = (r->time[r->row + 1] - from) / (double)r->pieces;
        if (r->piece == 0) {
            int stopped = record(r, r->row);
            if (stopped) return stopped;
        } else
            CALL(3, set_inputs(r, r->row));
        if (m && n) {
            CALL(1, r->set_time(r->component, from + (double)r->piece * h));
            CALL(2, r->set_states(r->component, x, (size_t)n));
            CALL(6, r->indicate(r->component, before, (size_t)m));
        }
        for (; r->piece < r->pieces; r->piece++) {
            const double t = from + (double)r->piece * h;
            r->reached = t;
            if (r->next <= t + h * (1.0 + 1e-9)) return EVENT;
            if (n) {
                CALL(4, slope(r, t, x, k1));
                for (long i = 0; i < n; i++) z[i] = x[i] + 0.5 * h * k1[i];
                CALL(4, slope(r, t + 0.5 * h, z, k2));
                for (long i = 0; i < n; i++) z[i] = x[i] + 0.5 * h * k2[i];
                CALL(4, slope(r, t + 0.5 * h, z, k3));
                for (long i = 0; i < n; i++) z[i] = x[i] + h * k3[i];
                CALL(4, slope(r, t + h, z, k4));
                for (long i = 0; i < n; i++) z[i] = x[i] + h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
            }
            if (m && n) {
                CALL(1, r->set_time(r->component, t + h));
                CALL(2, r->set_states(r->component, z, (size_t)n));
                CALL(6, r->indicate(r->component, after, (size_t)m));
                for (long i = 0; i < m; i++)
                    if ((before[i] > 0.0) != (after[i] > 0.0)) return EVENT;
                memcpy(before, after, (size_t)m * sizeof(double));
            }
            memcpy(x, z, (size_t)n * sizeof(double));
            if (r->complete2) {
                int event = 0, ended = 0;
                CALL(7, r->complete2(r->component, 1, &event, &ended));
                if (event || ended) { r->piece++; r->reached = t + h; return ended ? ENDED : EVENT; }
            } else if (r->complete3) {
                bool event = false, ended = false;
                CALL(7, r->complete3(r->component, true, &event, &ended));
                if (event || ended) { r->piece++; r->reached = t + h; return ended ? ENDED : EVENT; }
            }
        }
    }
    return record(r, r->row);
}

/* From the first row, initialised there. */
EXPORT int hc_replay_steps(hc_replay *r)
{
    for (r->row = 0; r->row < r->rows; r->row++) {
        CALL(3, set_inputs(r, r->row));
        CALL(5, get_outputs(r, r->row));
        if (r->row + 1 == r->rows) break;
        const double from = r->time[r->row], length = r->time[r->row + 1] - from;
        const long pieces = r->fixed > 0.0 ? (long)floor(length / r->fixed + 0.5) : r->pieces;
        const double h = length / (double)(pieces ? pieces : 1);
        for (long k = 0; k < pieces; k++) {
            const double t = from + (double)k * h;
            r->reached = t;
            if (r->step2) {
                CALL(8, r->step2(r->component, t, h, 1));
            } else {
                bool event = false, ended = false, early = false;
                double last = t + h;
                CALL(8, r->step3(r->component, t, h, true, &event, &ended, &early, &last));
                if (ended) return ENDED;
            }
        }
    }
    return DONE;
}
