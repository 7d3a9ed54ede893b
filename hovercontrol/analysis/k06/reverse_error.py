"""Which missing effect leaves the steady error of K06's real craft astern (section 6.2.2.3) [K06 fig 6.23].

K06 saw three things at once: astern the surge never came to what was told, whatever that was; ahead (figure
6.22) the steady errors were those of the simulation; sway and yaw agreed with the simulation. What is drawn
there is the navigation's own velocity, which is also what the law holds: a bias of the estimate would not
show in it. So each suspect is run astern at two references, and ahead.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hovercontrol.analysis.k06.trials import run_seeds
from hovercontrol.autopilot.limits import lossy_tables
from hovercontrol.core.block import Block
from hovercontrol.effects import Effect, effect
from hovercontrol.errors import InputError
from hovercontrol.hardware.actuators import FanTable
from hovercontrol.io.short_repr import short_repr
from hovercontrol.scenarios import Scenario, load_scenario
from hovercontrol.scenarios.definition import Phase
from hovercontrol.scenarios.parts import loop_parts
from hovercontrol.scenarios.real import real_loop

Array = NDArray[np.float64]

#: References astern [m/s]: that of table 6.3, and a slower one ("regardless of the selected reference").
ASTERN = (-0.76, -0.5)

#: Reference ahead [m/s], of table 6.2.
AHEAD = 1.1

#: From when on a run counts as steady [s].
STEADY = 9.0

#: An error as large would be seen in figure 6.23a, whose axis has ticks of 0.1 m/s [m/s].
VISIBLE = 0.05

#: Share of the thrust lost at a turned rudder, as in the scenarios of these trials.
_RUDDER_LOSS = 0.5


@dataclass(frozen=True)
class Suspect:
    """What a craft may have that its simulation has not.

    Parameters
    ----------
    effects : tuple of Effect, optional
        In its motion.
    starts_at : float, optional
        Least speed at which the fan pushes backward [RPM]; the controller's tables do not know. K06 measured
        reverse thrust from 6000 RPM on (figure 4.4), which is 0.12 N.
    """

    effects: tuple[Effect, ...] = ()
    starts_at: float = 0.0

    def fitted_to(self, trial: Scenario) -> Scenario:
        """Return a trial of the real loop, run with a craft that has it."""
        craft = dataclasses.replace(trial, plant=trial.belief.with_effects(self.effects), metrics=())
        assert craft.autopilot is not None
        if not self.starts_at:
            return craft
        known = lossy_tables(_RUDDER_LOSS)
        true = known[1]
        dead = (true.columns < 0) & (true.columns > -self.starts_at)
        values = np.where(dead, 0.0, true.values)
        pair = (known[0], FanTable("fan that starts late", "speed", true.rudder, true.columns, values))
        return dataclasses.replace(
            craft, autopilot=dataclasses.replace(craft.autopilot, tables=pair, rudder_loss=0.0)
        )


#: What K06 suspects, and what else could act, each of a size that would be seen if it did.
SUSPECTS: Mapping[str, Suspect] = {
    "nothing": Suspect(),
    "reverse thrust 30 % less": Suspect((effect("reverse_thrust_loss", 0.3),)),
    "reverse thrust 60 % less": Suspect((effect("reverse_thrust_loss", 0.6),)),
    "no reverse thrust below 6000 RPM": Suspect(starts_at=6000.0),
    "dead zone of the fan, 0.2 N": Suspect((effect("thrust_deadzone", width=0.2),)),
    "dry friction, 0.16 N": Suspect((effect("surge_coulomb", 0.06),)),
    "linear drag, 0.08 1/s": Suspect((effect("surge_linear_drag", 0.08),)),
    "rudder 0.1 rad off centre": Suspect((effect("rudder_offset", 0.1),)),
    "floor that slopes by 0.3 deg": Suspect((effect("slope", x=0.05),)),
}


@dataclass(frozen=True, eq=False)
class SteadyError:
    """Steady errors of one suspect over seeds, by the navigation: surge less what is told [m/s].

    Attributes
    ----------
    suspect : str
    astern : tuple of ndarray (runs,)
        At each reference of :data:`ASTERN`.
    ahead : ndarray, shape (runs,)
    yaw_rate : float
        Largest root mean square of the true yaw rate astern [rad/s].
    """

    suspect: str
    astern: tuple[Array, ...]
    ahead: Array
    yaw_rate: float

    __repr__ = short_repr

    def agrees(self, nothing: SteadyError) -> tuple[bool, bool]:
        """Tell whether both of K06's findings come out: an error at each reference astern, none ahead.

        Parameters
        ----------
        nothing : SteadyError
            That of the simulation, which has none of the suspects.
        """
        more = [
            abs(own.mean()) - abs(base.mean()) for own, base in zip(self.astern, nothing.astern, strict=True)
        ]
        return min(more) >= VISIBLE, abs(self.ahead.mean() - nothing.ahead.mean()) < VISIBLE


def steady_errors(
    suspects: Mapping[str, Suspect] = SUSPECTS,
    *,
    runs: int = 6,
    navigation: str = "magnetometer",
    progress: Callable[[float], None] | None = None,
) -> list[SteadyError]:
    """Return the steady errors that each suspect leaves in K06's real loop, with its gains.

    Parameters
    ----------
    suspects : mapping of str to Suspect, optional
    runs : int, optional
        Number of seeds.
    navigation : str, optional
        As of :func:`~hovercontrol.autopilot.autopilot`: sensors and filters in full, or with ``error_model``
        the noise of K06's own simulation.
    progress : callable, optional
        Called with the share that is done.

    Raises
    ------
    InputError
        If there is no suspect or no run.
    """
    if not suspects:
        raise InputError("steady_errors: expected one suspect at least, found none")
    back, front = (_trial(f"k06-real-{way}", navigation) for way in ("reverse", "forward"))
    jobs = [(back, ref) for ref in ASTERN] + [(front, AHEAD)]
    every = {e.name: e for one in suspects.values() for e in one.effects}
    loops: dict[tuple[str, float], Block] = {}
    found = []
    for i, (name, suspect) in enumerate(suspects.items()):
        errors, yaw = [], 0.0
        for j, (trial, ref) in enumerate(jobs):
            key = trial.name, suspect.starts_at
            if key not in loops:
                craft = dataclasses.replace(suspect, effects=tuple(every.values())).fitted_to(trial)
                loops[key] = real_loop(craft, loop_parts(craft))
            params = {"reference.surge_ref": ref} | _coefficients(trial, every, suspect)
            time, c = run_seeds(trial, loops[key], params, runs=runs)
            late = time >= STEADY
            errors.append(c["u_hat"][:, late].mean(axis=1) - ref)
            if trial is back:
                yaw = max(yaw, float(np.sqrt(np.mean(c["r"][:, late] ** 2))))
            if progress is not None:
                progress((i + (j + 1) / len(jobs)) / len(suspects))
        found.append(SteadyError(name, tuple(errors[:-1]), errors[-1], yaw))
    return found


def _trial(name: str, navigation: str) -> Scenario:
    scenario = load_scenario(name)
    assert scenario.autopilot is not None
    return dataclasses.replace(
        scenario, autopilot=dataclasses.replace(scenario.autopilot, navigation=navigation)
    )


def _coefficients(trial: Scenario, every: Mapping[str, Effect], suspect: Suspect) -> dict[str, float]:
    """Return the coefficients of all suspects' effects, zero but for this one's: one loop serves all."""
    plain = set(trial.belief.coefficients())
    own = trial.belief.with_effects(suspect.effects).coefficients()
    numbers = {p.name.rpartition(".")[2]: p for p in trial.belief.with_effects(every.values()).parameters()}
    return {
        f"plant.{key}": own.get(key, 0.0 if p.lower <= 0 else p.start)  # a friction's width is never zero
        for key, p in numbers.items()
        if key not in plain
    }


#: What is run for `diagnose`: both ways, halting between.
_LOGGED = (
    Phase("reverse", 10.0, setpoints={"surge_ref": -0.76}),
    Phase("stop", 14.0),
    Phase("forward", 21.0, setpoints={"surge_ref": 1.1}),
    Phase("stop", 25.0),
    Phase("reverse", 33.0, setpoints={"surge_ref": -0.5}),
)


def suspect_log(suspect: Suspect, seed: int = 1) -> Scenario:
    """Return a scenario whose log `diagnose` can be asked about: K06's craft with a suspect, both ways.

    Parameters
    ----------
    suspect : Suspect
    seed : int, optional
    """
    trial = load_scenario("k06-field-reverse")
    assert trial.autopilot is not None
    own = dataclasses.replace(trial.autopilot, seed=seed, rudder_loss=_RUDDER_LOSS)
    return suspect.fitted_to(dataclasses.replace(trial, phases=_LOGGED, autopilot=own))
