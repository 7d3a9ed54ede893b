"""What can be identified: a model or any Block, its parameters by name."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from hovercontrol.core.block import Block
from hovercontrol.core.derivatives import linear_parameters
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.estimation.subject import Subject
from hovercontrol.models.blockmodel import BlockModel
from hovercontrol.models.model import Model


@dataclass(frozen=True)
class PlainBlock(BlockModel):
    """A Block of which each parameter may be sought, by its full name."""

    @property
    def signature(self) -> tuple[Hashable, ...]:
        """The Block: its outputs, bounds and values, too; and the kinds of effects added to it."""
        return (self.block, *(type(e) for e in self.effects))

    def linear_coefficients(self) -> tuple[str, ...]:
        """Return the full names of the parameters in which the Block is linear."""
        own = tuple(self.block.parameter(name).name for name in linear_parameters(self.block))
        return (*own, *self._linear_in_effects())

    def coefficients(self) -> dict[str, float]:
        """Return every parameter's value by its full name."""
        return {p.name: p.start for p in self.block.parameters} | self._effect_coefficients()

    def coefficient_name(self, name: str) -> str:
        """Return the full name of a parameter."""
        return self.block.parameter(name).name

    def nominal_sizes(self) -> dict[str, float]:
        """Return the parameters' nominal sizes."""
        return {p.name: p.nominal for p in self.block.parameters}


def subject_of(model: Model | Block) -> Subject:
    """Return what the estimation engine takes for a model or a Block."""
    return model if isinstance(model, Model) else PlainBlock(model)


def chosen(model: Model | Block, names: Sequence[str] | None) -> tuple[str, ...]:
    """Return which coefficients are sought, as :func:`subject_of` names them.

    Parameters
    ----------
    model : Model or Block
    names : sequence of str or None
        With or without the Block's name in front; default: all linear coefficients.

    Raises
    ------
    InputError
        If a name is unknown (the nearest is named) or stands twice, or there is none.
    """
    subject = subject_of(model)
    known = {name.rpartition(".")[2]: name for name in subject.coefficients()}
    if names is None:
        found = list(subject.linear_coefficients())
    else:
        for name in names:
            if name.rpartition(".")[2] not in known:
                raise InputError(f"{model.name!r} has no coefficient {name!r}{did_you_mean(name, known)}")
        found = [subject.coefficient_name(name) for name in names]
        twice = [name for name, own in zip(names, found, strict=True) if found.count(own) > 1]
        if twice:
            raise InputError(f"coefficient {twice[0]!r} is named twice")
    if not found:
        raise InputError(f"{model.name!r} has no coefficients to identify")
    return tuple(found)
