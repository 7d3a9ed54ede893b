"""K06's rotating bench (section 6.2.1): tables 6.6 and 6.7, figures 6.13, 6.14 and 6.17 to 6.20."""

from __future__ import annotations

from pathlib import Path

from hovercontrol.control.analysis.output import Progress, quiet
from hovercontrol.documents.k06.bench.aids import save_aids
from hovercontrol.documents.k06.bench.square_wave import save_square_wave
from hovercontrol.documents.k06.bench.units import save_headings


def main(out: Path, progress: Progress = quiet, *, seeds: int = 16, walks: int = 9) -> list[Path]:
    """Draw tables 6.6 and 6.7 and figure 6.20 beside what K06 printed; mean and spread over seeds."""
    square = save_square_wave(out, seeds, walks)
    progress(0.5)
    by_aid = save_aids(out, seeds)
    progress(0.8)
    heading = save_headings(out, seeds)
    progress(1.0)
    return [*square, *by_aid, *heading]
