"""A monitor with 12 candidates, processor time: until it is C, a tick in C, and a step of its FMU.

The model's function computes the next states and all outputs. A step of the FMU (FMI 3) sets the measured
channels and commands, steps by the period, and reads 5 outputs. It executes the tick twice: at its end with
the inputs known then, and again when they are set.
"""

from __future__ import annotations

from collections.abc import Iterator
from os import times
from time import process_time

import numpy as np

import hovercontrol as hc
from benchmarks.do_step import times_in_c
from benchmarks.monitor import CANDIDATES, NOISE, PERIOD, motion, watch
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.fmi.exporter.variables import Interface

REPEATS = 15
#: Prints the least time of a tick over the repeats [ns]: of the FMU, and of the model's function.
_DRIVER = """
#include "hc_description.h"
#include "hc_fmi3.h"
#include "hc_model.h"
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const double column[N_INPUTS][N_ROWS] = {%s};
static const double start[] = {%s}, value[] = {%s};

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static void row(int k, double *u)
{
    for (int i = 0; i < N_INPUTS; i++)
        u[i] = column[i][k];
}

static double steps(void)
{
    fmi3ValueReference inputs[N_INPUTS], outputs[5];
    fmi3Instance i = fmi3InstantiateCoSimulation("one", hc_description.token, NULL, 0, 0, 0, 0, NULL, 0, NULL,
                                                 NULL, NULL);
    double u[N_INPUTS], y[5], last = 0.0, begin, end;
    bool event, terminate, early;
    int bad = fmi3EnterInitializationMode(i, 0, 0.0, 0.0, 0, 0.0);
    for (unsigned k = 0; k < N_INPUTS; k++)
        inputs[k] = INPUTS + k;
    for (unsigned k = 0; k < 5; k++)
        outputs[k] = OUTPUTS + k;
    row(0, u);
    bad |= fmi3SetFloat64(i, inputs, N_INPUTS, u, N_INPUTS) || fmi3ExitInitializationMode(i);
    begin = now();
    for (int k = 0; k < N_ROWS; k++) {
        row(k, u);
        bad |= fmi3SetFloat64(i, inputs, N_INPUTS, u, N_INPUTS);
        bad |= fmi3DoStep(i, PERIOD * k, PERIOD, 1, &event, &terminate, &early, &last);
        bad |= fmi3GetFloat64(i, outputs, 5, y, 5);
    }
    end = now();
    fmi3FreeInstance(i);
    if (bad)
        exit(1);
    return (end - begin) / N_ROWS;
}

static double ticks(void)
{
    static double x[N_STATES], next[N_STATES];
    double u[N_INPUTS];
    memcpy(x, start, sizeof start);
    memcpy(next, start, sizeof start);
    const double begin = now();
    for (int k = 0; k < N_ROWS; k++) {
        row(k, u);
        hc_model.tick(0, PERIOD * k, x, u, value, NULL, next);
        memcpy(x, next, sizeof x);
    }
    return (now() - begin) / N_ROWS;
}

int main(void)
{
    double (*const both[])(void) = {steps, ticks};
    for (int what = 0; what < 2; what++) {
        double best = 1e300;
        for (int repeat = 0; repeat < REPEATS; repeat++) {
            const double t = both[what]();
            best = t < best ? t : best;
        }
        printf("%%.1f\\n", best);
    }
    return 0;
}
"""


def tick_times(block: hc.Block, log: hc.Log) -> list[float]:
    """Return the time of a step of the monitor's FMU, and of a tick of its model [ns]."""
    interface = Interface(block)
    model = interface.block
    rng = np.random.default_rng(1)
    seen = {k: v + NOISE.get(k, 0.0) * rng.normal(size=v.size) for k, v in log.columns.items()}
    columns = [seen.get(s.name, 0 * log.time) for s in block.inputs]

    def listed(values: Iterator[float]) -> str:
        return ", ".join(repr(float(v)) for v in values)

    driver = _DRIVER % (
        ", ".join("{" + listed(iter(c)) + "}" for c in columns),
        listed(s.start for s in model.states),
        listed(s.start for s in model.parameters),
    )
    macros = {
        "INPUTS": interface.first("input"), "OUTPUTS": interface.first("output"), "PERIOD": PERIOD,
        "N_INPUTS": len(columns), "N_ROWS": log.time.size, "N_STATES": len(model.states), "REPEATS": REPEATS,
    }  # fmt: skip
    return times_in_c(interface, driver, macros)


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    log, begin = motion(), process_time()
    block = watch(log, CANDIDATES, 1.0, False)
    yield "building the Block", f"{process_time() - begin:.1f} s", "5 s", process_time() - begin <= 5.0
    begin = process_time()
    interface = Interface(block)
    source = c_source(interface.block, friction=interface.friction, partials=interface.differentiable)
    spent = process_time() - begin
    yield "writing it as C", f"{spent:.1f} s, {len(source.splitlines())} lines", "", None
    before = times()
    step, tick = tick_times(block, log)
    spent = times().children_user - before.children_user
    yield "compiling the FMU and running it", f"{spent:.1f} s", "", None
    yield "a tick", f"{tick / 1e3:.2f} us", "5 us", tick <= 5e3
    yield "a step of the FMU", f"{step / 1e3:.2f} us", "", None
