/* A point of an FMU for Model Exchange, set and read by one call: time, states and inputs go to the FMU where they
   differ from those that it has, then derivatives, outputs or event indicators are read.

   After a new time the states are set again. */

#include <stddef.h>
#include <stdint.h>
#include <string.h>

#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif

enum { DONE = 0, TIME, STATES, INPUTS, RATES, OUTPUTS, INDICATORS };

typedef struct {
    double now; /* the time wanted [s] */
    void *component;
    long fmi;
    size_t states, inputs, outputs, indicators;
    int (*set_time)(void *, double);
    int (*set_states)(void *, const double *, size_t);
    int (*get_rates)(void *, double *, size_t);
    int (*get_indicators)(void *, double *, size_t);
    int (*set2)(void *, const uint32_t *, size_t, const double *);
    int (*get2)(void *, const uint32_t *, size_t, double *);
    int (*set3)(void *, const uint32_t *, size_t, const double *, size_t);
    int (*get3)(void *, const uint32_t *, size_t, double *, size_t);
    const uint32_t *input_references, *output_references;
    size_t input_count, output_count;
    double *x, *u, *rates, *y, *z;       /* what the FMU has; what was read */
    double time;                         /* that the FMU has */
    long has_time, has_states, has_inputs; /* whether time, x and u are the FMU's */
    long status;                         /* of the call refused */
} hc_point;

#define CALL(what, c) do { int s_ = (c); if (s_ > 1) { p->status = s_; return what; } } while (0)

EXPORT int hc_point_set(hc_point *p, const double *x, const double *u)
{
    const size_t nx = p->states * sizeof(double), nu = p->inputs * sizeof(double);
    if (!p->has_time || p->time != p->now) {
        p->time = p->now;
        p->has_time = 1;
        p->has_states = 0;
        CALL(TIME, p->set_time(p->component, p->now));
    }
    if (nx && !(p->has_states && memcmp(x, p->x, nx) == 0)) {
        memcpy(p->x, x, nx);
        p->has_states = 1;
        CALL(STATES, p->set_states(p->component, p->x, p->states));
    }
    if (nu && !(p->has_inputs && memcmp(u, p->u, nu) == 0)) {
        memcpy(p->u, u, nu);
        p->has_inputs = 1;
        if (p->fmi == 2)
            CALL(INPUTS, p->set2(p->component, p->input_references, p->input_count, p->u));
        else
            CALL(INPUTS, p->set3(p->component, p->input_references, p->input_count, p->u, p->inputs));
    }
    return DONE;
}

EXPORT int hc_point_rates(hc_point *p, const double *x, const double *u)
{
    const int refused = hc_point_set(p, x, u);
    if (refused || !p->states) return refused;
    CALL(RATES, p->get_rates(p->component, p->rates, p->states));
    return DONE;
}

EXPORT int hc_point_outputs(hc_point *p, const double *x, const double *u)
{
    const int refused = hc_point_set(p, x, u);
    if (refused || !p->outputs) return refused;
    if (p->fmi == 2)
        CALL(OUTPUTS, p->get2(p->component, p->output_references, p->output_count, p->y));
    else
        CALL(OUTPUTS, p->get3(p->component, p->output_references, p->output_count, p->y, p->outputs));
    return DONE;
}

EXPORT int hc_point_indicators(hc_point *p, const double *x, const double *u)
{
    const int refused = hc_point_set(p, x, u);
    if (refused || !p->indicators) return refused;
    CALL(INDICATORS, p->get_indicators(p->component, p->z, p->indicators));
    return DONE;
}
