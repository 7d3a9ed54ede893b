"""The columns that a log must have, depending on its model."""

from __future__ import annotations

import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.plant_model import PlantModel
from hovercontrol.blocks.units import Dimension, dimension
from hovercontrol.logs.column_units import unit_at_end
from hovercontrol.logs.log import POSE, UNITS, VELOCITY

#: Least likeness of a signal's name and a word of a column's name, a ratio of :mod:`difflib`.
ALIKE = 0.8


@dataclass(frozen=True)
class RequiredColumns:
    """The columns that a log must have besides ``time``.

    Attributes
    ----------
    inputs : mapping of str to str
        Columns that are all required, with their units.
    outputs : mapping of str to str
        Columns of which at least one is required, with their units; may be empty.
    motion : bool
        Whether all of ``x, y, psi`` or all of ``u, v, r`` are required (the log of a craft).
    """

    inputs: Mapping[str, str] = field(default_factory=dict)
    outputs: Mapping[str, str] = field(default_factory=dict)
    motion: bool = False

    @classmethod
    def of(
        cls,
        model: PlantModel | Block | None,
        inputs: Sequence[str] | Mapping[str, str] = (),
        motion: bool = False,
    ) -> RequiredColumns:
        """Return the requirements of a model: its inputs, and a craft's motion or any output of a Block.

        Parameters
        ----------
        inputs : sequence of str, or mapping of str to str, optional
            Further inputs; a mapping also gives their units.
        motion : bool, optional
            Whether motion is required even without a model.
        """
        more = dict(inputs) if isinstance(inputs, Mapping) else dict.fromkeys(inputs, "")
        if model is None:
            return cls(more, {}, motion)
        block = model if isinstance(model, Block) else model.plant(late=True)
        craft = not isinstance(model, Block) and model.is_craft
        own = {s.name: s.unit for s in block.inputs}
        seen = {s.name: s.unit for s in (*block.outputs, *block.states) if s.name not in own}
        return cls({**more, **own}, {} if craft else seen, motion or craft)

    def needed(self, *more: str) -> dict[str, str]:
        """Return the columns that are all required, and their units: time, inputs and further ones."""
        return {"time": "s"} | dict(self.inputs) | {name: self.inputs.get(name, "") for name in more}

    def check(self, file: str, names: Sequence[str], units: Mapping[str, str] | None = None) -> None:
        """Raise if a file lacks columns.

        Parameters
        ----------
        file : str
            Name of the file for the error message.
        names : sequence of str
            Its columns, by signal name.
        units : mapping of str to str, optional
            Units that the file states, by its own names.

        Raises
        ------
        InputError
            The message names the first column, the nearest one, and the option that maps all that lack.
        """
        absent = {name: unit for name, unit in self.inputs.items() if name not in names}
        text, optional = f"no column {next(iter(absent))!r}" if absent else "", {}
        if self.outputs and not any(name in names for name in self.outputs):
            optional = dict(self.outputs)
            expected = f"expected one of the columns {', '.join(optional)}"
            text = text or f"{expected}, but there is no {next(iter(optional))!r}"
        if self.motion and not any(all(name in names for name in triple) for triple in (POSE, VELOCITY)):
            triple = max(POSE, VELOCITY, key=lambda triple: sum(name in names for name in triple))
            motion = {name: UNITS[name] for name in triple if name not in names}
            expected = "expected all of x, y, psi or all of u, v, r"
            text = text or f"{expected}, but there is no column {next(iter(motion))!r}"
            absent |= motion
        if text:
            wanted = {*self.inputs, *self.outputs, *((*POSE, *VELOCITY) if self.motion else ()), "time"}
            free = [name for name in names if name not in wanted]
            hint = did_you_mean(next(iter(absent or optional)), names)
            raise InputError(f"{file}: {text}{hint} ({_how(absent, optional, free, units or {})})")


def _how(
    absent: Mapping[str, str], optional: Mapping[str, str], free: Sequence[str], units: Mapping[str, str]
) -> str:
    """Return how columns are mapped: all that are `absent`, and the `optional` ones that names suggest."""
    known = "; rows at a known period: --period SECONDS" if "time" in absent else ""
    if free and all(name.isdigit() for name in free):
        name = next(iter(absent or optional))
        return f"there is no header: --columns {name}=NUMBER of the column, from 1{known}"
    found = suggested({**absent, **optional}, free, units)
    named = [name for name in optional if name in found] or ([] if absent else [next(iter(optional))])
    text = ",".join(f"{name}={found.get(name, 'NAME')}" for name in (*absent, *named))
    return f"a column of another name: --columns {shlex.quote(text)}{known}"


def suggested(wanted: Mapping[str, str], names: Sequence[str], units: Mapping[str, str]) -> dict[str, str]:
    """Return columns with their units that names or units suggest for signals.

    A column fits by a word of its name. By its unit it fits a signal if no other of the columns and
    signals left has that dimension.

    Parameters
    ----------
    wanted : mapping of str to str
        Signals and their units.
    names : sequence of str
        Columns of the file.
    units : mapping of str to str
        Units that the file states.

    Examples
    --------
    >>> suggested({"time": "s", "thrust": "N", "psi": "rad"}, ["t_ms", "heading_deg", "thrust_N"], {})
    {'thrust': 'thrust_N', 'time': 't_ms:ms', 'psi': 'heading_deg:deg'}
    >>> suggested({"F": "N", "v": "m/s"}, ["speed_km_h", "push_N"], {})
    {'F': 'push_N', 'v': 'speed_km_h:km/h'}
    """
    of = {name: units.get(name) or unit_at_end(name) or _after_underscores(name) for name in names}
    found: dict[str, str] = {}
    for ours in wanted:
        words = {word: n for n in reversed(names) if n not in found.values() for word in _words(n)}
        near = get_close_matches(ours.lower(), words, n=1, cutoff=ALIKE)
        found |= {ours: words[near[0]]} if near else {}
    open_signals = {ours: _dimension(unit) for ours, unit in wanted.items() if ours not in found and unit}
    free = {n: d for n in names if n not in found.values() and (d := _dimension(of[n])) is not None}
    for ours, own in open_signals.items():
        fitting = [n for n, d in free.items() if d == own]
        if len(fitting) == 1 and list(open_signals.values()).count(own) == 1:
            found[ours] = fitting[0]
    return {o: n if n in units else _with_unit(n, of[n], wanted[o]) for o, n in found.items()}


def _with_unit(name: str, unit: str, wanted: str) -> str:
    """Return a column with the unit that its name states, where it has to be converted."""
    own = _dimension(unit)
    same = unit == wanted or own is None or (wanted and own != _dimension(wanted))
    return name if same else f"{name}:{unit}"


def _after_underscores(name: str) -> str:
    """Return the unit at the end of ``speed_km_h``, ``push_N``: km/h, N; empty if there is none."""
    parts = name.split("_")
    ends = ("/".join(parts[k:]) for k in range(max(1, len(parts) - 2), len(parts)))
    return next((end for end in ends if _dimension(end) is not None), "")


def _words(name: str) -> list[str]:
    return [name.lower(), *re.findall(r"[a-z]+", name.lower())]


def _dimension(unit: str) -> Dimension | None:
    try:
        return dimension(unit) if unit else None
    except InputError:
        return None
