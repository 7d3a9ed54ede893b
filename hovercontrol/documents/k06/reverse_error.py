"""Which missing effect leaves the steady error of K06's real craft astern (section 6.2.2.3) [K06 fig 6.23].

K06 saw three things: astern the surge velocity never reached its reference, whatever the reference; ahead
(figure 6.22) the steady errors were those of the simulation; sway and yaw agreed with the simulation. The
figure shows the navigation's velocity estimate, which the law holds too: a bias of the estimate would not
show in it. Each suspected effect is therefore run astern at two references, and ahead.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.control.analysis.output import Progress, quiet, save
from hovercontrol.control.autopilot.limits import lossy_tables
from hovercontrol.craft.effects import Effect, effect
from hovercontrol.craft.hardware.actuators import FanTable
from hovercontrol.documents.scenarios import Scenario, load_scenario, run_scenario
from hovercontrol.documents.scenarios.definition import Phase
from hovercontrol.documents.scenarios.parts import loop_parts
from hovercontrol.documents.scenarios.real import real_loop
from hovercontrol.documents.scenarios.trials import run_seeds
from hovercontrol.identification.diagnose import diagnose

#: References astern [m/s]: that of table 6.3, and a slower one ("regardless of the selected reference").
ASTERN = (-0.76, -0.5)

#: Reference ahead [m/s], of table 6.2.
AHEAD = 1.1

#: A run counts as steady from this time [s].
STEADY = 9.0

#: Smallest error that would be visible in figure 6.23a, whose axis has ticks of 0.1 m/s [m/s].
VISIBLE = 0.05

#: Share of the thrust lost at a turned rudder, as in the scenarios of these trials.
_RUDDER_LOSS = 0.5


@dataclass(frozen=True)
class Suspect:
    """An effect that the real craft may have and its simulation lacks.

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
        """Return a trial of the real loop with a craft that has the effect."""
        craft = dataclasses.replace(trial, plant=trial.belief.with_effects(self.effects), metrics=())
        if not self.starts_at:
            return craft
        known = lossy_tables(_RUDDER_LOSS)
        true = known[1]
        dead = (true.columns < 0) & (true.columns > -self.starts_at)
        values = np.where(dead, 0.0, true.values)
        pair = (known[0], FanTable("fan that starts late", "speed", true.rudder, true.columns, values))
        return craft.with_autopilot(tables=pair, rudder_loss=0.0)


#: The effects that K06 suspects, and others, each large enough to be visible.
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
    """Steady errors of one suspect over seeds: surge velocity by the navigation less its reference [m/s].

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
        """Return whether both of K06's findings hold: an error at each reference astern, and none ahead.

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
        As of :func:`~hovercontrol.control.autopilot.autopilot`: sensors and filters in full, or with
        ``error_model`` the noise of K06's own simulation.
    progress : callable, optional
        Called with the share that is done.

    Raises
    ------
    InputError
        If there is no suspect or no run.
    """
    if not suspects:
        raise InputError("steady_errors: expected one suspect at least, found none")
    back, front = (
        load_scenario(f"k06-real-{way}").with_autopilot(navigation=navigation)
        for way in ("reverse", "forward")
    )
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


def _coefficients(trial: Scenario, every: Mapping[str, Effect], suspect: Suspect) -> dict[str, float]:
    """Return the coefficients of all suspects' effects, zero except this one's: one loop serves all."""
    plain = set(trial.belief.coefficients())
    own = trial.belief.with_effects(suspect.effects).coefficients()
    numbers = {p.name.rpartition(".")[2]: p for p in trial.belief.with_effects(every.values()).parameters()}
    return {
        f"plant.{key}": own.get(key, 0.0 if p.lower <= 0 else p.start)  # a friction's width is never zero
        for key, p in numbers.items()
        if key not in plain
    }


#: By what stands for the navigation, its name in :func:`steady_errors`.
NOISES = {"sensors and filters in full": "magnetometer", "K06's noise": "error_model"}

#: The phases of a log for `diagnose`: both ways, halting between.
_LOGGED = (
    Phase("reverse", 10.0, setpoints={"surge_ref": -0.76}),
    Phase("stop", 14.0),
    Phase("forward", 21.0, setpoints={"surge_ref": 1.1}),
    Phase("stop", 25.0),
    Phase("reverse", 33.0, setpoints={"surge_ref": -0.5}),
)


def suspect_log(suspect: Suspect, seed: int = 1) -> Scenario:
    """Return a scenario for a log that `diagnose` can analyse: K06's craft with a suspect, both ways.

    Parameters
    ----------
    suspect : Suspect
    seed : int, optional
    """
    trial = load_scenario("k06-field-reverse").with_autopilot(seed=seed, rudder_loss=_RUDDER_LOSS)
    return suspect.fitted_to(dataclasses.replace(trial, phases=_LOGGED))


# ---- the picture ------------------------------------------------------------------------------------

#: The suspects of which a log is diagnosed: forces that are missing in the logged commands.
LOGGED = ("reverse thrust 60 % less", "dead zone of the fan, 0.2 N", "dry friction, 0.16 N")


def main(
    out: Path, progress: Progress = quiet, *, runs: int = 6, logged: Sequence[str] = LOGGED
) -> list[Path]:
    """Run each suspect in reverse and ahead by both models of the noise; diagnose logs of some."""
    found: dict[str, list[SteadyError]] = {}
    for k, (noise, navigation) in enumerate(NOISES.items()):
        part = lambda share, k=k: progress(0.4 * (k + share))  # noqa: E731
        found[noise] = steady_errors(runs=runs, navigation=navigation, progress=part)
    words = _words(found, runs)
    for k, name in enumerate(logged):
        words.append(_diagnosed(name))
        progress(0.8 + 0.2 * (k + 1) / len(logged))
    return save(out, "k06_reverse_error", _figure(found, runs), {"k06_reverse_error": _columns(found)}, words)


def _words(found: Mapping[str, Sequence[SteadyError]], runs: int) -> list[str]:
    refs = ", ".join(f"{ref:g}" for ref in ASTERN)
    lines = [
        f"Mean surge velocity by the navigation less its reference [m/s], {runs} seeds; "
        f"references {refs} and {AHEAD:g} m/s.",
        "K06: in reverse an error at every reference, ahead none beyond the simulation's.",
    ]
    for noise, errors in found.items():
        lines.append(f"With {noise}:")
        lines += _table(errors)
        explains = [one.suspect for one in errors if all(one.agrees(errors[0]))]
        lines.append(f"With {noise}, both as K06 saw them: {'; '.join(explains) or 'none of these'}.")
    lines.append(
        f"An error counts from {VISIBLE:g} m/s beyond the simulation's. K06 prints no size of the error; its "
        "gauge resolved 0.1 N. Friction beside a dead zone is not excluded."
    )
    lines.append(
        "A bias of the velocity's estimate is excluded: the law holds that estimate, and it is what is drawn."
    )
    return lines


def _table(errors: Sequence[SteadyError]) -> list[str]:
    """Return a line for each suspect: its mean errors, and whether they are K06's."""
    lines = []
    for one in errors:
        back, front = one.agrees(errors[0])
        means = ", ".join(f"{a.mean():+.3f}" for a in (*one.astern, one.ahead))
        verdict = f"{'an' if back else 'no'} error in reverse, {'none' if front else 'one'} ahead"
        lines.append(f"{one.suspect:34s} {means}: {verdict}")
    return lines


def _diagnosed(name: str) -> str:
    scenario = suspect_log(SUSPECTS[name])
    found = diagnose(scenario.belief, [run_scenario(scenario).log()])
    named = ", ".join(f"{e.parameter} {e.value:.3g} +- {e.std:.1g} {e.unit}".strip() for e in found.effects)
    return f"diagnose on 33 s of log with {name}: {found.verdict}; {named or 'nothing named'}"


def _figure(found: Mapping[str, Sequence[SteadyError]], runs: int) -> Figure:
    suspects = [one.suspect for one in next(iter(found.values()))]
    figure = Figure(figsize=(10.5, 1.6 + 0.45 * len(suspects)), layout="constrained")
    places = figure.subplots(1, len(found), sharex=True, sharey=True, squeeze=False)[0]
    rows = np.arange(len(suspects))[::-1]
    cases = [f"reference {ref:g} m/s" for ref in (*ASTERN, AHEAD)]
    for axes, (noise, errors) in zip(places, found.items(), strict=True):
        for k, (case, mark) in enumerate(zip(cases, "ovD", strict=True)):
            values = [(*one.astern, one.ahead)[k] for one in errors]
            means, spread = [e.mean() for e in values], [e.std() for e in values]
            axes.errorbar(means, rows + 0.2 * (1 - k), xerr=spread, fmt=mark, ms=5, color=f"C{k}", label=case)
        axes.axvline(0.0, color="0.6", lw=0.8)
        axes.set_yticks(rows, suspects)
        axes.set_xlabel("surge velocity by the navigation\nless its reference, 9 to 15 s [m/s]")
        axes.set_title(noise, fontsize=10)
        axes.grid(axis="x", alpha=0.3)
    handles, labels = places[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=9)
    figure.suptitle(
        f"K06's real loop with each suspected effect: mean and spread of {runs} seeds", fontsize=11
    )
    return figure


def _columns(found: Mapping[str, Sequence[SteadyError]]) -> dict[str, list[Any]]:
    every = [(noise, one) for noise, errors in found.items() for one in errors]
    columns: dict[str, list[Any]] = {
        "noise": [noise for noise, _ in every],
        "suspect": [one.suspect for _, one in every],
    }
    for k, ref in enumerate((*ASTERN, AHEAD)):
        errors = [(*one.astern, one.ahead)[k] for _, one in every]
        columns[f"mean error, reference {ref:g} [m/s]"] = [float(e.mean()) for e in errors]
        columns[f"spread, reference {ref:g} [m/s]"] = [float(e.std()) for e in errors]
    columns["yaw rate in reverse, rms [rad/s]"] = [one.yaw_rate for _, one in every]
    return columns
