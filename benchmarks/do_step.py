"""fmi3DoStep of the plant, 1 ms, called from C: inputs that stay, and inputs that change at every step."""

from __future__ import annotations

import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from hovercontrol.blocks.backends.compiler import find_compiler
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts
from hovercontrol.fmi.exporter.sources import fmu_sources
from hovercontrol.fmi.exporter.variables import Interface

STEPS, REPEATS = 20_000, 25
_FLAGS = "-O3 -std=c99 -fno-math-errno -ffp-contract=off -D_POSIX_C_SOURCE=200809L".split()  # noqa: SIM905
#: Prints, for each case, the least time of a step over the repeats [ns].
_DRIVER = """
#include "hc_description.h"
#include "hc_fmi3.h"
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { CONSTANT, CHANGING, STICKING, CHANGING_AND_READ };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

static double run(int what)
{
    const fmi3ValueReference inputs[] = {INPUTS, INPUTS + 1}, states[] = {1, 2, 3, 4, 5, 6};
    fmi3Instance i = fmi3InstantiateCoSimulation("one", hc_description.token, NULL, 0, 0, 0, 0, NULL, 0, NULL,
                                                 NULL, NULL);
    double u[] = {3.0, 0.1}, x[6] = {0.0}, last = 0.0, begin, end;
    bool event, terminate, early;
    int bad = fmi3EnterInitializationMode(i, 0, 0.0, 0.0, 0, 0.0) || fmi3SetFloat64(i, inputs, 2, u, 2) ||
              (what == STICKING && fmi3SetFloat64(i, states, 6, x, 6)) || fmi3ExitInitializationMode(i);
    begin = now();
    for (int k = 0; k < STEPS; k++) {
        if (what != CONSTANT) {
            u[0] = what == STICKING ? 0.01 * (k * 7 % 13) : 2.0 + 0.1 * (k * 7 % 13);
            u[1] = 2e-4 * (abs(k % 4000 - 2000) - 1000); /* from side to side in 4 s */
            bad |= fmi3SetFloat64(i, inputs, 2, u, 2);
        }
        bad |= fmi3DoStep(i, 1e-3 * k, 1e-3, 1, &event, &terminate, &early, &last);
        if (what == CHANGING_AND_READ)
            bad |= fmi3GetFloat64(i, states, 6, x, 6);
    }
    end = now();
    fmi3FreeInstance(i);
    if (bad)
        exit(1);
    return (end - begin) / STEPS;
}

int main(void)
{
    for (int what = CONSTANT; what <= CHANGING_AND_READ; what++) {
        double best = 1e300;
        for (int repeat = 0; repeat < REPEATS; repeat++) {
            const double t = run(what);
            best = t < best ? t : best;
        }
        printf("%.1f\\n", best);
    }
    return 0;
}
"""


def times_in_c(interface: Interface, driver: str, values: Mapping[str, float]) -> list[float]:
    """Compile the sources of an FMU (FMI 3) with a main program, run it, and return what it prints.

    Parameters
    ----------
    driver : str
        Main program in C.
    values : mapping of str to float
        Macros for it, by name.
    """
    files = fmu_sources(interface, 3, 1e-6, 1e-9)
    macros = [f"-D{name}={value}" for name, value in values.items()]
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {**files, "driver.c": driver}.items():
            Path(folder, name).write_text(text, encoding="utf-8")
        sources = sorted(path.name for path in Path(folder).glob("*.c"))
        command = [*find_compiler(), *_FLAGS, *macros, *sources, "-o", "driver", "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        done = subprocess.run([Path(folder, "driver")], check=True, capture_output=True, text=True)
    return [float(line) for line in done.stdout.split()]


def step_times() -> list[float]:
    """Return the times of a step [ns] in the four cases of the driver."""
    interface = Interface(loop_parts(load_scenario("table1"))["plant"], "events")
    macros = {"INPUTS": interface.first("input"), "STEPS": STEPS, "REPEATS": REPEATS}
    return times_in_c(interface, _DRIVER, macros)


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    constant, changing, sticking, read = step_times()
    yield "inputs stay", f"{constant:.0f} ns", "<= 200 ns", constant <= 200
    yield (
        "inputs change at every step, fmi3SetFloat64 counted",
        f"{changing:.0f} ns",
        "<= 200 ns",
        changing <= 200,
    )
    yield "the same while surge and yaw stick", f"{sticking:.0f} ns", "", None
    yield "as the second, and fmi3GetFloat64 of all states", f"{read:.0f} ns", "", None
