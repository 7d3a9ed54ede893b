"""A scenario: a craft, its references or commands, and the phases of the run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.control.autopilot import Imperfections
from hovercontrol.craft.hardware.actuators import FanTable, ServoTable, VariablePitch
from hovercontrol.craft.hardware.sensors import Beacons
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.vehicles import HOVERDEMON_BODY, Body


@dataclass(frozen=True)
class Phase:
    """An interval of the run with constant parameters.

    Parameters
    ----------
    name : str
    until : float
        End of the phase [s].
    scale : mapping, optional
        Factors on the plant's coefficients, by name.
    adaptation : float, optional
        Weight of the estimates in the controller: 0 for the model's values, 1 for the estimates.
    setpoints : mapping, optional
        Set points of a law, by the name of its input (``yaw_rate_ref``); default: its start value.
    """

    name: str
    until: float
    scale: Mapping[str, float] = field(default_factory=dict)
    adaptation: float = 0.0
    setpoints: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Metric:
    """A figure of merit: a statistic of a quantity over a window, and its expected range.

    Parameters
    ----------
    name : str
    of : str
        ``tracking_error``, ``estimation_error``, or a signal of the run (``r``).
    start, end : float
        The window [s], both included.
    low, high : float, optional
        Expected range.
    unit, paper : str, optional
        Unit of the value; text of the source document.
    statistic : str, optional
        One of :data:`hovercontrol.documents.scenarios.measures.STATISTICS`.
    target, within : float, optional
        Target value of statistics other than ``mean`` ... ``peak``; tolerance of ``reached`` and ``settled``.
    """

    name: str
    of: str
    start: float
    end: float
    low: float = -math.inf
    high: float = math.inf
    unit: str = "m"
    paper: str = ""
    statistic: str = "mean"
    target: float = 0.0
    within: float = 0.0


@dataclass(frozen=True)
class Sampling:
    """Sampling of measurements and commands of a sampled loop.

    Parameters
    ----------
    measurement : float
        Period of the measurements [s].
    command : float, optional
        Period of the commands in closed loop [s] (default: that of the measurements).
    position_noise, heading_noise : float
        Standard deviations [m, rad].
    velocity_noise, rate_noise : float, optional
        Standard deviations [m/s, rad/s] of measured body velocities. If neither is given, velocities are
        backward differences of the pose.
    log : float, optional
        Period of the log's rows [s], a multiple of that of the measurements; 0 for the same.
    seed : int
    poor_view : mapping, optional
        Arguments of :func:`hovercontrol.craft.hardware.sensors.poor_view`: a part of the floor with more
        noise.
    """

    measurement: float
    command: float = 0.0
    position_noise: float = 0.0
    heading_noise: float = 0.0
    velocity_noise: float | None = None
    rate_noise: float | None = None
    log: float = 0.0
    seed: int = 0
    poor_view: Mapping[str, Any] | None = None


@dataclass(frozen=True)
class Autopilot:
    """Sensors, links, actuators between law and craft: see :func:`hovercontrol.control.autopilot.autopilot`.

    Parameters
    ----------
    navigation : str, optional
    tables : tuple of two FanTable, optional
    servo : ServoTable, optional
    propeller : VariablePitch, optional
    beacons : Beacons, optional
    rudder_loss : float, optional
    seed : int, optional
    imperfections : Imperfections, optional
    """

    navigation: str = "magnetometer"
    tables: tuple[FanTable, FanTable] | None = None
    servo: ServoTable | None = None
    propeller: VariablePitch | None = None
    beacons: Beacons | None = None
    rudder_loss: float = 0.0
    seed: int = 1
    imperfections: Imperfections = field(default_factory=Imperfections)


@checked
@dataclass(frozen=True)
class Scenario:
    """A complete scenario; made by :func:`hovercontrol.documents.scenarios.load_scenario`.

    ``plant`` is the craft that moves, ``belief`` the controller's model of it. Either a ``controller``
    closes the loop, or ``commands`` are played (columns by name, each held until the next). The tracking
    controller follows ``reference``; one of K06's laws gets set points from the phases, or by ``guidance``,
    and knows ``body``. With ``autopilot`` that law runs in the real loop, beside the ideal one. ``file`` is
    the path it was loaded from, if it is not one of the package's; errors name it.

    Parameters
    ----------
    name, title, source : str
        Name, title and source.
    step : float
        Time between rows of the log [s].
    plant, belief : Model
    start : mapping of str to float
        Initial states other than zero.
    phases : tuple of Phase
    reference, guidance, controller, estimator : mapping, optional
        Sections of the file: a ``kind`` and its numbers.
    actuation : mapping, optional
    body : Body, optional
    commands : mapping of str to tuple of float, optional
    sampling : Sampling, optional
    autopilot : Autopilot, optional
    metrics : tuple of Metric, optional
    file : str, optional

    Examples
    --------
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> load_scenario("table1").title
    'C17 Table I: simulated loop with estimator'
    """

    name: str
    title: str
    source: str
    step: float
    plant: Model
    belief: Model
    start: Mapping[str, float]
    phases: tuple[Phase, ...]
    reference: Mapping[str, Any] | None = None
    guidance: Mapping[str, Any] | None = None
    controller: Mapping[str, Any] | None = None
    actuation: Mapping[str, Any] = field(default_factory=dict)
    body: Body = HOVERDEMON_BODY
    estimator: Mapping[str, Any] | None = None
    commands: Mapping[str, tuple[float, ...]] | None = None
    sampling: Sampling | None = None
    autopilot: Autopilot | None = None
    metrics: tuple[Metric, ...] = ()
    file: str = ""

    __repr__ = short_repr

    def with_autopilot(self, **changes: Any) -> Scenario:
        """Return the scenario with other settings of its autopilot.

        Parameters
        ----------
        **changes
            As for :class:`Autopilot`.

        Raises
        ------
        InputError
            If it has no autopilot.

        Examples
        --------
        >>> from hovercontrol.documents.scenarios import load_scenario
        >>> load_scenario("k06-real-stop").with_autopilot(seed=2).autopilot.seed
        2
        """
        if self.autopilot is None:
            raise InputError(f"{self.name!r} is no trial of the real loop: it has no [autopilot]")
        return replace(self, autopilot=replace(self.autopilot, **changes))

    @property
    def end(self) -> float:
        """Length of the run [s]."""
        return self.phases[-1].until

    @property
    def tracks(self) -> bool:
        """Whether the tracking controller closes the loop."""
        return self.controller is not None and "kind" not in self.controller
