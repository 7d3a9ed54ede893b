"""A loop as it runs on hardware: sampled measurements with noise, commands sent at their own period and held.

The plant is integrated between events only, so that no tick, command or phase change is smeared. C17's
experiment measures the pose at 100 Hz, differences it for velocities and sends commands every 22.5 ms.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hovercontrol.block import Block
from hovercontrol.estimators.sampled import SampledEstimator
from hovercontrol.hybrid import Ticking
from hovercontrol.interconnect import interconnect
from hovercontrol.scenarios.definition import Phase, Sampling, Scenario
from hovercontrol.scenarios.result import Run
from hovercontrol.targets.numpy import call_scalar, numpy_functions
from hovercontrol.targets.runge_kutta import rk4
from hovercontrol.ticks import Clock

#: Longest step between events [s]: friction of width 0.01 settles in about 7 ms.
MAX_STEP = 0.0025

MOTION = ("x", "y", "psi", "u", "v", "r")


@dataclass
class _Event:
    time: float
    measure: bool
    command: bool
    row: bool
    phase: Phase


def run_sampled(
    scenario: Scenario, parts: Mapping[str, Block], progress: Callable[[float], None] | None = None
) -> Run:
    """Run a sampled scenario; see :func:`hovercontrol.scenarios.runner.run_scenario`.

    The log has what the loop sees: the pose with noise and velocities by backward difference; the columns
    ``true_x ... true_r`` have the truth.
    """
    assert scenario.sampling is not None
    plant = _Plant(scenario, parts["plant"])
    sensor = _Sensor(scenario.sampling, plant.state)
    pilot = _pilot(scenario, parts)
    rows: list[dict[str, float]] = []
    for event in _events(scenario):
        plant.advance(event.time)
        plant.enter(event.phase)
        if event.measure:
            motion = sensor.measure(event.time, plant.state)
            pilot.sense(event.time, motion, plant.commands)
        if event.command:
            plant.commands = pilot.command(event.time, motion, event.phase)
        if event.row:
            truth = {f"true_{n}": v for n, v in zip(MOTION, plant.state, strict=True)}
            commands = dict(zip(plant.names, plant.commands, strict=True))
            rows.append(
                {"time": event.time, **motion, **commands, **pilot.columns(event.time, plant.state), **truth}
            )
            if progress is not None:
                progress(event.time)
    columns = {key: np.array([row[key] for row in rows]) for key in rows[0]}
    return Run(scenario, columns.pop("time"), columns)


def _events(scenario: Scenario) -> Iterator[_Event]:
    """Yield every tick once, in order; periods are counted exactly, so ticks that fall together are one."""
    sampling = scenario.sampling
    assert sampling is not None
    played = () if scenario.commands is None else scenario.commands["time"]
    periods = [sampling.measurement] if played else [sampling.measurement, sampling.command]
    also = [*(t for t in played if t <= scenario.end), *(phase.until for phase in scenario.phases)]
    clock = Clock([*periods, *also])
    measure, command = clock.count(sampling.measurement), clock.count(periods[-1])
    row = measure * round((sampling.log or sampling.measurement) / sampling.measurement)
    commanded = {clock.count(t) for t in played}
    ends = [clock.count(phase.until) for phase in scenario.phases[:-1]]
    for now in clock.instants(periods, scenario.end, also):
        yield _Event(
            clock.seconds(now),
            now % measure == 0,
            now in commanded if played else now % command == 0,
            now % row == 0,
            scenario.phases[bisect_right(ends, now)],
        )


class _Plant:
    """The craft between events."""

    def __init__(self, scenario: Scenario, block: Block) -> None:
        self.scenario = scenario
        self.block = block
        self.names = [s.name for s in block.inputs]
        self.rhs = numpy_functions(block).scalar_pair("derivatives")
        self.state = [s.start for s in block.states]
        self.commands = [s.start for s in block.inputs]
        self.params: Sequence[float] = block.parameter_values()
        self.phase: Phase | None = None
        self.time = 0.0

    def enter(self, phase: Phase) -> None:
        if phase is self.phase:
            return
        self.phase = phase
        own = self.scenario.plant.coefficients()
        changed = {f"plant.{name}": factor * own[name] for name, factor in phase.scale.items()}
        self.params = self.block.parameter_values(changed)

    def advance(self, until: float) -> None:
        if until > self.time:
            steps = math.ceil((until - self.time) / MAX_STEP - 1e-9)
            self.state = rk4(self.rhs, self.time, self.state, self.commands, self.params, until, steps)
            self.time = until


class _Sensor:
    """The pose with noise; velocities by backward difference (C17 section VIII-B) or measured with noise."""

    def __init__(self, sampling: Sampling, state: Sequence[float]) -> None:
        self.random = np.random.default_rng(sampling.seed)
        self.noise = (sampling.position_noise, sampling.position_noise, sampling.heading_noise)
        own = (sampling.velocity_noise, sampling.rate_noise)
        surge, rate = (noise or 0.0 for noise in own)
        self.velocity_noise = None if own == (None, None) else (surge, surge, rate)
        self.before: tuple[float, list[float]] | None = None
        self.first = list(state)

    def measure(self, time: float, state: Sequence[float]) -> dict[str, float]:
        pose = self._noisy(state[:3], self.noise)
        if self.velocity_noise is not None:
            velocity = self._noisy(state[3:6], self.velocity_noise)
        elif self.before is None:
            velocity = self.first[3:]
        else:
            then, old = self.before
            rate = [(new - was) / (time - then) for new, was in zip(pose, old, strict=True)]
            cos, sin = math.cos(pose[2]), math.sin(pose[2])
            velocity = [cos * rate[0] + sin * rate[1], -sin * rate[0] + cos * rate[1], rate[2]]
        self.before = (time, pose)
        return dict(zip(MOTION, [*pose, *velocity], strict=True))

    def _noisy(self, values: Sequence[float], noise: Sequence[float]) -> list[float]:
        return [v + s * self.random.standard_normal() for v, s in zip(values, noise, strict=True)]


def _pilot(scenario: Scenario, parts: Mapping[str, Block]) -> _Tracker | _Law | _Player:
    if scenario.controller is None:
        return _Player(scenario, parts["plant"])
    return _Tracker(scenario, parts) if scenario.tracks else _Law(scenario, parts)


class _Law:
    """One of K06's laws, and what tells it its set points, on the sampled motion."""

    def __init__(self, scenario: Scenario, parts: Mapping[str, Block]) -> None:
        own = [block for role, block in parts.items() if role != "plant"]
        self.law = Ticking(interconnect(own, "law"))
        self.plant_inputs = [s.name for s in parts["plant"].inputs]
        self.told: dict[str, float] = {}
        self.phase: Phase | None = None

    def sense(self, time: float, motion: Mapping[str, float], commands: Sequence[float]) -> None:
        """Keep nothing: a law sees the motion at its tick."""

    def command(self, time: float, motion: Mapping[str, float], phase: Phase) -> list[float]:
        if phase is not self.phase:
            self.law.set_parameters({f"reference.{name}": value for name, value in phase.setpoints.items()})
            self.phase = phase
        self.told = self.law.tick(time, motion)
        return [self.told[name] for name in self.plant_inputs]

    def columns(self, time: float, state: Sequence[float]) -> dict[str, float]:
        """Return what the parts of the law told each other at the last tick."""
        return {k: v for k, v in self.told.items() if k not in self.plant_inputs}


class _Tracker:
    """Estimator and tracking controller on the sampled motion."""

    def __init__(self, scenario: Scenario, parts: Mapping[str, Block]) -> None:
        self.controller, self.reference = parts["controller"], parts["reference"]
        self.control = numpy_functions(self.controller).scalar_pair("outputs")
        self.refer = numpy_functions(self.reference).scalar_pair("outputs")
        self.estimator: SampledEstimator | None = None
        if scenario.estimator is not None:
            block = scenario.belief.plant().with_values(scenario.start)
            assert scenario.sampling is not None
            self.estimator = SampledEstimator(block, dt=scenario.sampling.measurement, **scenario.estimator)
        self.inputs = [s.name for s in self.controller.inputs]
        self.n_commands = len(self.controller.outputs) - 2
        self.plant_inputs = [s.name for s in parts["plant"].inputs]

    def sense(self, time: float, motion: Mapping[str, float], commands: Sequence[float]) -> None:
        if self.estimator is not None:
            held = dict(zip(self.plant_inputs, commands, strict=True))
            measured = [motion[name] for name in self.estimator.measured]
            self.estimator.step(time, measured, [held[name] for name in self.estimator.inputs])

    def command(self, time: float, motion: Mapping[str, float], phase: Phase) -> list[float]:
        return self._outputs(time, motion, phase.adaptation)[: self.n_commands]

    def columns(self, time: float, state: Sequence[float]) -> dict[str, float]:
        """Return reference, true tracking error and estimates."""
        truth = dict(zip(MOTION, state, strict=True))
        error = self._outputs(time, truth, 0.0)[self.n_commands :]
        return {**self._reference(time), "error_x": error[0], "error_y": error[1], **self._estimates()}

    def _outputs(self, time: float, motion: Mapping[str, float], adaptation: float) -> list[float]:
        known = {**motion, **self._reference(time), **self._estimates()}
        share = (
            {"controller.adaptation": adaptation}
            if "controller.adaptation" in self.controller.default_parameters
            else {}
        )
        values = self.controller.parameter_values(share)
        return list(call_scalar(self.control, time, [], [known[n] for n in self.inputs], values))

    def _reference(self, time: float) -> dict[str, float]:
        values = call_scalar(self.refer, time, [], [], self.reference.parameter_values())
        return dict(zip([s.name for s in self.reference.outputs], values, strict=True))

    def _estimates(self) -> dict[str, float]:
        if self.estimator is None:
            return {}
        return {f"{name}_hat": value for name, value in self.estimator.coefficients.items()}


class _Player:
    """Commands played from a table, each held until the next."""

    def __init__(self, scenario: Scenario, plant: Block) -> None:
        assert scenario.commands is not None
        self.table = scenario.commands
        self.names = [s.name for s in plant.inputs]
        self.starts = {s.name: s.start for s in plant.inputs}

    def sense(self, time: float, motion: Mapping[str, float], commands: Sequence[float]) -> None:
        """Nothing is fed back."""

    def command(self, time: float, motion: Mapping[str, float], phase: Phase) -> list[float]:
        row = self.table["time"].index(time)
        return [self.table[n][row] if n in self.table else self.starts[n] for n in self.names]

    def columns(self, time: float, state: Sequence[float]) -> dict[str, float]:
        return {}
