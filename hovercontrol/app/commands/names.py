"""Names for shell completion. Each function runs when Tab is pressed and imports only what it needs."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import hovercontrol


def of(*values: str) -> Callable[[], tuple[str, ...]]:
    """Return a function that returns these values."""
    return lambda: values


def vehicles() -> list[str]:
    """Return the package's craft."""
    from hovercontrol.craft.models.vehicles import VEHICLES

    return list(VEHICLES)


def scenarios() -> list[str]:
    """Return the package's scenarios, by their files: importing the package of scenarios takes seconds."""
    folder = Path(hovercontrol.__file__).parent / "documents" / "scenarios"
    return sorted(file.stem for file in folder.glob("*.toml"))


def exportable() -> list[str]:
    """Return the scenarios and craft that can be exported as FMUs."""
    return [*scenarios(), *vehicles()]


def effects(incomplete: str) -> Iterator[str]:
    """Yield the effects, after those already typed, as in ``slope,wi``."""
    from hovercontrol.craft.effects import effect_names

    return _listed(incomplete, effect_names())


def platforms(incomplete: str) -> Iterator[str]:
    """Yield the platforms of FMUs, after those already typed."""
    from hovercontrol.fmi.exporter.binaries import PLATFORMS

    return _listed(incomplete, [*PLATFORMS, "all"])


def _listed(incomplete: str, names: list[str]) -> Iterator[str]:
    written = "".join(incomplete.rpartition(",")[:2])
    return (f"{written}{name}" for name in names)
