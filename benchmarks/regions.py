"""Regions judged by simulation: C17's gains, and Monte Carlo of the loop with its estimator; wall clock."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from hovercontrol.control.analysis import decay
from hovercontrol.documents.c17.gain_region import gain_region
from hovercontrol.documents.c17.interconnection import region_of_attraction

POINTS, CELLS, RUNS = 200, 10, 100


def rows() -> Iterator[tuple[str, str, str, bool | None]]:
    gain_region(points=2)  # the libraries are built
    region_of_attraction(cells=2, runs=1)
    begin, loops = time.perf_counter(), 2 * POINTS**2
    gains = gain_region(points=POINTS)
    spent = time.perf_counter() - begin
    half = spent / 2  # the map is simulated twice, without limits of the commands and with them
    yield f"C17's gains, {POINTS} x {POINTS}: {loops} closed loops of 20 s", f"{spent:.1f} s", "", None
    yield f"{POINTS**2} closed loops: half of that", f"{half:.1f} s", "<= 10 s", half <= 10
    wrong = len(gains.outside("guaranteed", "simulated"))
    share = gains.share("guaranteed", "simulated")
    yield "gains that Theorem 3 guarantees but a simulation refutes", f"{wrong}", "0", wrong == 0
    yield "share of the truly stable gains that it guarantees", f"{share:.1%}", "stated", None
    rates = decay(2.0, 2.0)
    text = f"{float(np.squeeze(rates.guaranteed)):.3f} of {float(np.squeeze(rates.true)):.3f} 1/s"
    yield "guaranteed decay of the errors at k1 = k2 = 2", text, "stated", None
    begin = time.perf_counter()
    attraction = region_of_attraction(cells=CELLS, runs=RUNS)
    spent = time.perf_counter() - begin
    loops = CELLS**2 * RUNS
    yield f"Monte Carlo, {loops} loops of 20 s with estimator", f"{spent:.1f} s", "<= 20 s", spent <= 20
    yield "of them on the ellipse in the end", f"{attraction['in the end'].mean():.2%}", "stated", None
