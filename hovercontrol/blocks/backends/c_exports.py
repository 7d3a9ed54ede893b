"""The functions that the shared library of a Block exports; :mod:`.library` calls them."""

from __future__ import annotations

EXPORTS = """#include "hc_runner.h"
#include "hc_simulate.h"
#ifdef _WIN32
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
EXPORT void block_derivatives(double t, const double *x, const double *u, const double *p, double *dx)
{
    hc_model.derivatives(t, x, u, p, 0, dx);
}
EXPORT void block_outputs(double t, const double *x, const double *u, const double *p, double *y)
{
    hc_model.outputs(t, x, u, p, 0, y);
}
EXPORT int block_lanes(void)
{
    return hc_model_lanes ? HC_LANES : 1;
}
EXPORT int block_simulate(const hc_part *part, const hc_options *options, const double *times, long n_times,
                          double *x, const double *u, const double *p, double *states, double *outputs,
                          double *reached)
{
    return hc_simulate_part(&hc_model, part, options, times, n_times, x, u, p, states, outputs, reached);
}
EXPORT int block_advance(const hc_options *options, const double *times, double *x, const double *u,
                         const double *p)
{
    return hc_advance(&hc_model, options, times[0], times[1], x, u, p);
}
EXPORT int block_sweep(const hc_part *part, const hc_options *options, const double *times, long n_times,
                       long n_runs, const double *x, const double *u, const double *p, double from,
                       const double *band, double *figures, double *final, int *status)
{
    return hc_sweep_part(&hc_model, part, hc_model_lanes, options, times, n_times, n_runs, x, u, p, from,
                         band, figures, final, status);
}
EXPORT void *runner_new(const hc_options *options, double *y)
{
    return hc_runner_new(&hc_model, options, y);
}
EXPORT void runner_free(void *runner)
{
    hc_runner_free(runner);
}
EXPORT int runner_begin(void *runner, double t, const double *x, const double *u, const double *p)
{
    return hc_runner_begin(runner, t, x, u, p);
}
EXPORT int runner_step(void *runner, double until, const double *u)
{
    return hc_runner_step(runner, until, u);
}
EXPORT int runner_jump(void *runner, const double *x, const int *given, const double *p)
{
    return hc_runner_jump(runner, x, given, p);
}
EXPORT double runner_time(const void *runner)
{
    return hc_runner_time(runner);
}
EXPORT void runner_states(const void *runner, double *x)
{
    hc_runner_states(runner, x);
}
EXPORT long runner_size(const void *runner)
{
    return hc_runner_size(runner);
}
EXPORT void runner_save(const void *runner, double *into)
{
    hc_runner_save(runner, into);
}
EXPORT void runner_load(void *runner, const double *from)
{
    hc_runner_load(runner, from);
}
"""
