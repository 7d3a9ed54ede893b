"""10,000 runs by an importer that makes random calls in every order that FMI permits, against parabolas."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

from tests.fmi.adversary import sled, worst

RUNS = 10_000
BAR = 1e-9


def rows() -> Iterator[tuple[str, str, str, bool]]:
    """Yield each figure: half of the runs are Model Exchange, half Co-Simulation."""
    with tempfile.TemporaryDirectory() as folder:
        for version in (2, 3):
            path = sled().to_fmu(Path(folder) / f"sled{version}.fmu", version=version, friction="events")
            most, choices = worst(path, range(RUNS // 4))
            yield (
                f"FMI {version}: off [m, m/s] in {RUNS // 2} runs of {choices} choices",
                f"{most:.1e}",
                f"< {BAR:g}",
                most < BAR,
            )
