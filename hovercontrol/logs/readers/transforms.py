"""Transforms of ROS composed along a chain of frames: `base_link` in `map` through `odom`.

The lowest transform gives the rows. Those above it are interpolated at its stamps, positions linearly and
rotations along the shortest arc, as tf2's ``lookupTransform`` does. Outside their stamps
the result is missing. A transform of ``/tf_static`` is valid at all times.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.logs.readers.tables import Table

_NAMES = (
    *(f"transform.translation.{axis}" for axis in "xyz"),
    *(f"transform.rotation.{axis}" for axis in "xyzw"),
)


@dataclass(frozen=True)
class Link:
    """A transform from a frame to its parent, and the table of its rows."""

    parent: str
    table: Table
    topic: str

    @property
    def fixed(self) -> bool:
        """Whether the transform is valid at all times."""
        return self.topic.rpartition("/")[2] == "tf_static"


def composed(file: Path, links: Mapping[str, Link]) -> list[Table]:
    """Return a table of each moving frame in each fixed frame, where other moving frames lie between.

    Parameters
    ----------
    links : mapping of str to Link
        The transform of each frame that has one parent.
    """
    return [
        _table(file, frame, chain)
        for frame, link in links.items()
        if not link.fixed
        for chain in _chains(frame, links)
    ]


def _chains(frame: str, links: Mapping[str, Link]) -> Iterator[list[Link]]:
    """Yield the links from a frame up to each ancestor above which nothing moves, if two or more move."""
    chain: list[Link] = []
    while frame in links and links[frame] not in chain:
        chain.append(links[frame])
        frame = chain[-1].parent
    for n in range(2, len(chain) + 1):
        if sum(not link.fixed for link in chain[:n]) > 1 and all(link.fixed for link in chain[n:]):
            yield chain[:n]


def _table(file: Path, frame: str, chain: Sequence[Link]) -> Table:
    own = chain[0]
    name = f"{own.topic}[{frame} in {chain[-1].parent}]"
    clock = f"{name}/time"

    @cache
    def poses() -> dict[str, Any]:
        # T_a^c = T_a^b T_b^c: p_a = p_ab + R_ab p_bc, R_ac = R_ab R_bc
        times, place, turn = _rows(own)
        known = np.ones(times.size, dtype=bool)
        for link in chain[1:]:
            inside, above, rotation = _at(link, times)
            place, turn = above + rotation.apply(place), rotation * turn
            known &= inside
        values = np.where(known[:, None], np.hstack([place, turn.as_quat()]), np.nan)
        return dict(zip((clock, *(f"{name}/{n}" for n in _NAMES)), (times, *values.T), strict=True))

    frames = " <- ".join([frame, *(link.parent for link in chain)])
    table = Table(
        file,
        name,
        [clock, *(f"{name}/{n}" for n in _NAMES)],
        own.table.rows,
        lambda names: {n: poses()[n] for n in names},
        clock,
        {clock: "ns"},
    )
    table.said = f"transforms composed at the stamps of {frame}: {frames}"
    return table


def _rows(link: Link) -> tuple[Any, Any, Any]:
    """Return times [ns], positions and rotations of a transform."""
    from scipy.spatial.transform import Rotation

    names = [f"{link.table.name}/{name}" for name in _NAMES]
    found = link.table.columns([link.table.clock, *names])
    values = np.column_stack([found[name] for name in names])
    return found[link.table.clock], values[:, :3], Rotation.from_quat(values[:, 3:])


def _at(link: Link, times: Any) -> tuple[Any, Any, Any]:
    """Return a transform at other times: where it is known, position and rotation."""
    from scipy.spatial.transform import Slerp

    own, place, turn = _rows(link)
    own, first = np.unique(own, return_index=True)
    place, turn = place[first], turn[first]
    if link.fixed or own.size == 1:
        last = [own.size - 1] * times.size
        return np.full(times.size, link.fixed) | (times == own[0]), place[last], turn[last]
    inside = (times >= own[0]) & (times <= own[-1])
    at = (np.clip(times, own[0], own[-1]) - own[0]) / 1e9
    mine = (own - own[0]) / 1e9
    return inside, np.column_stack([np.interp(at, mine, p) for p in place.T]), Slerp(mine, turn)(at)
