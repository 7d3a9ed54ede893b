"""What the pilot orders, checked before anything is told: the same for the ideal loop and the real one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from hovercontrol.cockpit.checks import checked_number, checked_numbers
from hovercontrol.cockpit.disturbances import Disturbance
from hovercontrol.cockpit.laws import STICK, Choice
from hovercontrol.core.signals import Signal
from hovercontrol.errors import InputError, did_you_mean, shown
from hovercontrol.models.model import Model


class Flown(ABC):
    """A craft in the loop with what the pilot chose to fly it with; simulated time, no clock on the wall.

    Parameters
    ----------
    model : Model
        With the effects that disturbances need.
    switches : mapping of str to bool, optional
        What can be switched besides, and how it is at first.

    Attributes
    ----------
    kind : str
        ``ideal`` or ``real``.
    inputs : tuple of Signal
        The plant's.
    law : str
        Key of the present choice.
    references : dict of str to dict of str to float
        What each law is told, by its key.
    switched_on : dict of str to dict of str to float
        The numbers of the disturbances that act.
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
        """Put the craft where it started, at rest and at time 0; law, references, disturbances stay."""

    @abstractmethod
    def advance(self, until: float) -> None:
        """Let simulated time go on to `until` [s], a multiple of 1 ms.

        Raises
        ------
        InputError
            If the motion is no longer a number.
        """

    @abstractmethod
    def signals(self) -> dict[str, float]:
        """Return what there is to see now, by name, in SI units."""

    @abstractmethod
    def modes(self) -> dict[str, tuple[str, ...]]:
        """Return the names of the modes that the present law tells, by signal."""

    @abstractmethod
    def notes(self) -> str:
        """Return what the pilot should know of what acts, or ``""``."""

    def command(
        self,
        *,
        law: str | None = None,
        references: Mapping[str, Any] | None = None,
        stick: tuple[Any, Any] | None = None,
        disturbances: Mapping[str, Mapping[str, Any] | None] | None = None,
        switches: Mapping[str, Any] | None = None,
    ) -> None:
        """Tell the loop what the pilot wants from now on; all of it or, if wrong, nothing.

        Parameters
        ----------
        law : str, optional
            Key of one of the choices. The motion of the craft goes on as it is.
        references : mapping of str to float, optional
            Of that law, by name (``surge_ref``); SI units. A wanted heading is taken as the nearest turn.
        stick : tuple of float, optional
            Forward and to the right, -1 to 1; only the laws ``manual``, ``motion`` and ``steer`` look at it.
        disturbances : mapping, optional
            By key its numbers by name, or None to switch it off.
        switches : mapping of str to bool, optional
            By key.

        Raises
        ------
        InputError
            If a name is unknown (the nearest is named) or a value is no number within its bounds.
        """
        key = self.law if law is None else str(law)
        if key not in self.choices:
            raise InputError(f"unknown law {shown(key)}{did_you_mean(key, self.choices)}")
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
        """Let orders act that were checked: whether another law, references or disturbances were told."""

    def _checked_disturbances(
        self, given: Mapping[str, Mapping[str, Any] | None]
    ) -> dict[str, dict[str, float]]:
        acting = dict(self.switched_on)
        for name, values in given.items():
            if name not in self.disturbances:
                raise InputError(f"unknown disturbance {shown(name)}{did_you_mean(name, self.disturbances)}")
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
