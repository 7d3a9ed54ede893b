"""Pilot commands, validated before they are applied; the same for the ideal and the real loop."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from hovercontrol.app.cockpit.checks import checked_number, checked_numbers
from hovercontrol.app.cockpit.disturbances import Disturbance
from hovercontrol.app.cockpit.laws import STICK, Choice
from hovercontrol.base.errors import InputError, check_known, did_you_mean, shown
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.models.model import Model


class Flown(ABC):
    """A craft in the loop with the pilot's choices, in simulated time.

    Parameters
    ----------
    model : Model
        The craft with the effects of disturbances.
    switches : mapping of str to bool, optional
        Further switches and their initial values.

    Attributes
    ----------
    kind : str
        ``ideal`` or ``real``.
    inputs : tuple of Signal
        The plant's.
    law : str
        Key of the present choice.
    references : dict of str to dict of str to float
        References of each law, by its key.
    switched_on : dict of str to dict of str to float
        Numbers of the active disturbances.
    stick : tuple of float
        Forward, to the right.
    switches : dict of str to bool
        What is on of transmission, lift fan and the like; none in the ideal loop.
    """

    kind: str
    inputs: tuple[Signal, ...]
    #: Columns of recordings besides motion and inputs, and the signals that they are.
    logged: Mapping[str, str] = MappingProxyType({})

    def __init__(
        self,
        model: Model,
        choices: Mapping[str, Choice],
        disturbances: Mapping[str, Disturbance],
        switches: Mapping[str, bool] | None = None,
    ) -> None:
        self.model, self.choices, self.disturbances = model, dict(choices), dict(disturbances)
        self.references = {key: {s.name: s.start for s in c.references} for key, c in choices.items()}
        self.switched_on: dict[str, dict[str, float]] = {}
        self.switches = dict(switches or {})
        self.law, self.stick = "manual", (0.0, 0.0)

    @property
    @abstractmethod
    def time(self) -> float:
        """Simulated time [s]."""

    @abstractmethod
    def reset(self) -> None:
        """Put the craft at its start, at rest and at time 0; law, references and disturbances are kept."""

    @abstractmethod
    def advance(self, until: float) -> None:
        """Advance simulated time to `until` [s], a multiple of 1 ms.

        Raises
        ------
        InputError
            If the motion is not a number any more.
        """

    @abstractmethod
    def signals(self) -> dict[str, float]:
        """Return the displayed signals by name, in SI units."""

    @abstractmethod
    def modes(self) -> dict[str, tuple[str, ...]]:
        """Return the names of the modes of the present law, by signal."""

    @abstractmethod
    def notes(self) -> str:
        """Return notes to the pilot on active disturbances, or ``""``."""

    def command(
        self,
        *,
        law: str | None = None,
        references: Mapping[str, Any] | None = None,
        stick: tuple[Any, Any] | None = None,
        disturbances: Mapping[str, Mapping[str, Any] | None] | None = None,
        switches: Mapping[str, Any] | None = None,
    ) -> None:
        """Apply the pilot's commands; if one is wrong, none is applied.

        Parameters
        ----------
        law : str, optional
            Key of one of the choices. The motion of the craft goes on as it is.
        references : mapping of str to float, optional
            References of that law, by name (``surge_ref``), in SI units. A heading is reached by the shorter
            turn.
        stick : tuple of float, optional
            Forward and to the right, -1 to 1; only the laws ``manual``, ``motion`` and ``steer`` look at it.
        disturbances : mapping, optional
            By key its numbers by name, or None to switch it off.
        switches : mapping of str to bool, optional
            By key.

        Raises
        ------
        InputError
            If a name is unknown, or a value is not a number within its bounds.
        """
        key = self.law if law is None else str(law)
        check_known(key, self.choices, f"unknown law {shown(key)}")
        known, before = self.choices[key].references, self.references[key]
        told = checked_numbers(f"law {key}", known, before, references or {})
        push = self.stick
        if stick is not None:
            push = (checked_number(STICK[0], stick[0]), checked_number(STICK[1], stick[1]))
        acting = self._checked_disturbances(disturbances or {})
        switched = self._checked_switches(switches or {})
        changed, self.law, self.stick = key != self.law, key, push
        self.references[key] = told
        self.switches |= switched
        if disturbances:
            self.switched_on = acting
        self._obey(changed, bool(references), bool(disturbances), switched)

    @abstractmethod
    def _obey(self, law: bool, references: bool, disturbances: bool, switched: Mapping[str, bool]) -> None:
        """Apply validated commands, with flags for a new law, references or disturbances."""

    def _checked_disturbances(
        self, given: Mapping[str, Mapping[str, Any] | None]
    ) -> dict[str, dict[str, float]]:
        acting = dict(self.switched_on)
        for name, values in given.items():
            check_known(name, self.disturbances, f"unknown disturbance {shown(name)}")
            knobs = [knob.signal for knob in self.disturbances[name].knobs]
            held = acting.pop(name, {s.name: s.start for s in knobs})
            if values is not None:
                acting[name] = checked_numbers(name, knobs, held, values)
        return acting

    def _checked_switches(self, given: Mapping[str, Any]) -> dict[str, bool]:
        for name, value in given.items():
            if name not in self.switches:
                known = did_you_mean(name, self.switches) if self.switches else ": the ideal loop has none"
                raise InputError(f"unknown switch {shown(name)}{known}")
            if not isinstance(value, bool):
                raise InputError(f"switch {name}: expected true or false, found {shown(value)}")
        return dict(given)
