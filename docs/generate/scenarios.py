"""Scenarios: runs of the source documents, with their figures of merit and pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from importlib import resources
from multiprocessing import get_context
from pathlib import Path

from generate.pages import code, picture, table, toctree, write
from hovercontrol.documents.scenarios import load_scenario, run_scenario, scenario_names
from hovercontrol.documents.scenarios.figures import figures
from hovercontrol.documents.scenarios.result import Measured

#: Which pictures a page shows, the first that a run has; the first one is the gallery's.
SHOWN = ("comparison", "tracking_error", "path", "estimates", "heading", "velocities")
MOST = 3


def pages(into: Path) -> tuple[str, str]:
    """Run every scenario and write its page."""
    names = scenario_names()
    run_all(names, into / "scenarios")
    rows = []
    for name in names:
        scenario = load_scenario(name)
        rows.append((f"[{scenario.title}](scenarios/{name}.md)", f"`{name}`", scenario.source))
    write(
        into / "scenarios.md",
        "# Scenarios",
        "`hovercontrol simulate NAME` runs one; each is a TOML file, and "
        "[yours work too](formats.md). `hovercontrol sweep NAME` varies its numbers.",
        table(("scenario", "name", "source"), rows),
        toctree(f"scenarios/{name}" for name in names),
    )
    return "scenarios", f"{len(names)} scenarios"


def run_all(names: Sequence[str], folder: Path) -> None:
    """Run scenarios and write their pages, on two cores."""
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as pool:  # each draws on its own
        list(pool.map(_page, names, [folder] * len(names)))


def first_picture(folder: Path, name: str) -> str:
    """Return the file of a scenario's first picture."""
    return next(file.name for key in SHOWN for file in sorted(folder.glob(f"{name}-{key}.*")))


def _page(name: str, folder: Path) -> None:
    scenario = load_scenario(name)
    run = run_scenario(scenario)
    every = figures(run)
    drawn = [key for key in SHOWN if key in every][:MOST]
    place = folder / name
    write(
        folder / f"{name}.md",
        f"# {scenario.title}",
        f"Scenario `{name}`. Source: {scenario.source}.",
        code(f"$ hovercontrol simulate {name} --out out/{name}", "console"),
        "## Figures of merit",
        table(
            ("figure", "window", "measured", "expected", "the source says"),
            [_row(found) for found in run.metrics()],
        )
        or "None: the scenario makes a log for `diagnose` or a picture.",
        "## Pictures",
        *(picture(every[key], place.with_name(f"{name}-{key}"), f"{name}: {key}") for key in drawn),
        "## The file",
        code(_text(name), "toml"),
    )


def _text(name: str) -> str:
    return (resources.files("hovercontrol.documents.scenarios") / f"{name}.toml").read_text(encoding="utf-8")


def _row(found: Measured) -> tuple[str, ...]:
    m = found.metric
    window = f"{m.start:g} s" if m.start == m.end else f"{m.start:g} to {m.end:g} s"
    wanted = f"{m.low:g} to {m.high:g}"
    if math.isinf(m.low):
        wanted = "" if math.isinf(m.high) else f"below {m.high:g}"
    elif math.isinf(m.high):
        wanted = f"above {m.low:g}"
    mark = "" if found.met else ", **outside**"
    return m.name, window, f"{found.value:.3g} {m.unit}{mark}", wanted, m.paper
