"""The columns that a log must have, depending on its model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.plant_model import PlantModel
from hovercontrol.logs.log import POSE, VELOCITY


@dataclass(frozen=True)
class Wanted:
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
    ) -> Wanted:
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

    def check(self, file: str, names: Sequence[str]) -> None:
        """Raise if a file lacks a column.

        Parameters
        ----------
        file : str
            Name of the file for the error message.
        names : sequence of str
            Its columns, by signal name.

        Raises
        ------
        InputError
            The message names the column, the nearest one, and the option that maps it.
        """
        for name in self.inputs:
            if name not in names:
                raise InputError(f"{file}: no column {_missing(name, names)}")
        if self.outputs and not any(name in names for name in self.outputs):
            first = _missing(next(iter(self.outputs)), names)
            raise InputError(
                f"{file}: expected one of the columns {', '.join(self.outputs)}, but there is no {first}"
            )
        if self.motion and not any(all(name in names for name in triple) for triple in (POSE, VELOCITY)):
            triple = max(POSE, VELOCITY, key=lambda triple: sum(name in names for name in triple))
            absent = _missing(next(name for name in triple if name not in names), names)
            raise InputError(
                f"{file}: expected all of x, y, psi or all of u, v, r, but there is no column {absent}"
            )


def _missing(name: str, names: Sequence[str]) -> str:
    others = [other for other in names if other != "time"]  # that of a period
    if others and all(other.isdigit() for other in others):
        how = f"there is no header: --columns {name}=NUMBER of the column, from 1"
    else:
        how = f"a column of another name: --columns {name}=NAME"
    known = "; rows at a known period: --period SECONDS" if name == "time" else ""
    return f"{name!r}{did_you_mean(name, names)} ({how}{known})"
