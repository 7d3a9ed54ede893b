"""Runs with and without each effect: what it changes, on which manoeuvre it shows, which others do the same.

A craft drives a family of manoeuvres, once without and once with the effect, at a size that changes the
motion by a fifth. What the model's own coefficients could take up is projected out (finite differences), as
a fit would do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

import hovercontrol as hc
from hovercontrol.craft.effects import Effect, Shape, effect_class, effect_names
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.diagnose.experiment.manoeuvres import Manoeuvre, family

Array = NDArray[np.float64]

#: The craft, and the limits of their commands: a rudder craft that also drives astern, and one with fans.
CRAFT = {
    "rudder": ("c17_simulation", {"thrust": (-1.5, 4.0), "rudder": (-0.45, 0.45)}),
    "fan": ("four_fan", {f.name: (0.0, 0.12) for f in hc.vehicle("four_fan").fans}),
}

#: From row to row [s].
STEP = 0.05

#: By how much of its root mean square an effect shall change the motion it is shown with.
SIZE = 0.2

#: Cosine of two effects' changes above which they are called near twins.
NEAR = 0.9

#: What a log tells of the motion: velocities as measured, and those of the pose as measured.
CHANNELS = ("u", "v", "r", "along", "across", "turning")
UNITS = {"u": "u [m/s]", "v": "v [m/s]", "r": "r [rad/s]"}


@dataclass(frozen=True)
class Craft:
    """A craft, its manoeuvres, its motion on them, and how each of its coefficients changes that."""

    model: Model
    manoeuvres: list[Manoeuvre]
    runs: list[dict[str, Array]]
    scale: dict[str, float]
    moved: dict[str, Array]


@dataclass(frozen=True)
class Seen:
    """An effect at a size at which it shows.

    Attributes
    ----------
    base, model : Model
        Without the effect and with it.
    effect : Effect
    craft : Craft
    change : ndarray
        Of all channels on all manoeuvres, scaled, what the coefficients take up projected out.
    """

    base: Model
    model: Model
    effect: Effect
    craft: Craft
    change: Array

    def shown_by(self) -> list[tuple[str, float]]:
        """Return the manoeuvres and what is left of the change on each, largest first."""
        parts = np.split(self.change, len(self.craft.manoeuvres))
        sizes = [float(np.sqrt(np.mean(part**2))) for part in parts]
        names = [m.name for m in self.craft.manoeuvres]
        return sorted(zip(names, sizes, strict=True), key=lambda row: -row[1])

    @property
    def labels(self) -> tuple[str, str]:
        """What the two runs are of."""
        name = self.effect.name
        if name in {e.name for e in self.base.effects}:
            value = self.base.effect(name).values["value"]
            return f"{name} = {value:.4g}", f"{name} = {self.effect.values['value']:.4g}"
        return "without", f"with {name}"

    @property
    def manoeuvre(self) -> Manoeuvre:
        """The manoeuvre that shows the effect best."""
        best = self.shown_by()[0][0]
        return next(m for m in self.craft.manoeuvres if m.name == best)

    def figure(self) -> Figure:
        """Return path and velocities without and with the effect."""
        k = self.craft.manoeuvres.index(self.manoeuvre)
        before, (after,) = self.craft.runs[k], runs(self.model, [self.manoeuvre])
        figure = Figure(figsize=(8.0, 4.2), layout="constrained")
        grid = figure.add_gridspec(3, 2)
        path = figure.add_subplot(grid[:, 0])
        for found, style, label in zip((before, after), ("C0-", "C3--"), self.labels, strict=True):
            path.plot(found["x"], found["y"], style, lw=1.3, label=label)
        path.set(xlabel="x [m]", ylabel="y [m]")
        path.set_aspect("equal", adjustable="datalim")
        path.legend(loc="upper center", bbox_to_anchor=(0.5, 1.12), ncols=2, fontsize="small")
        first = None
        for row, (name, label) in enumerate(UNITS.items()):
            first = figure.add_subplot(grid[row, 1], sharex=first)
            first.plot(self.manoeuvre.time, before[name], "C0-", lw=1.1)
            first.plot(self.manoeuvre.time, after[name], "C3--", lw=1.1)
            first.set_ylabel(label)
            first.margins(x=0)
            first.tick_params(labelbottom=row == 2)
        assert first is not None
        first.set_xlabel("time [s]")
        return figure


@dataclass(frozen=True)
class Runs:
    """All effects."""

    seen: dict[str, Seen]

    def twins(self, name: str) -> list[tuple[str, float]]:
        """Return the effects of the same craft whose change looks alike, nearest first."""
        own = self.seen[name]
        found = []
        for other, that in self.seen.items():
            if other != name and that.craft is own.craft:
                size = np.linalg.norm(own.change) * np.linalg.norm(that.change)
                cosine = float(abs(own.change @ that.change) / size) if size else 0.0
                if cosine > NEAR:
                    found.append((other, cosine))
        return sorted(found, key=lambda row: -row[1])


@cache
def every_run() -> Runs:
    """Return every effect of the catalogue in runs."""
    craft = {kind: driven(kind) for kind in CRAFT}
    return Runs({name: seen_by(name, craft) for name in effect_names()})


def runs(model: Model, manoeuvres: Sequence[Manoeuvre]) -> list[dict[str, Array]]:
    """Return what a log of each manoeuvre would hold, without noise."""
    late = {n.rpartition(".")[2] for n in model.timing() if n}
    delay = sum(model.coefficients()[name] for name in late)
    block = model.plant(late=True)
    compiled = block.compile(friction="smooth")
    return [_run(compiled, [m.commands[s.name] for s in block.inputs], delay) for m in manoeuvres]


def _run(compiled: Any, commands: Sequence[Array], delay: float) -> dict[str, Array]:
    fine, count = 5, commands[0].size  # the commands of a delayed craft arrive between rows
    times = np.arange(fine * count) * STEP / fine
    at = np.clip(((times - delay) / STEP + 1e-9).astype(int), 0, count - 1)
    sent = [np.where(times >= delay, row[at], 0.0) for row in commands]
    done = compiled.simulate(times, sent)
    found = dict(zip(done.output_labels, done.outputs[:, ::fine], strict=True))
    found |= {k.removesuffix("_measured"): v for k, v in found.items() if k.endswith("_measured")}
    rate = {k: np.gradient(found[k], STEP) for k in ("x", "y", "psi")}
    cos, sin = np.cos(found["psi"]), np.sin(found["psi"])
    found["along"], found["across"] = rate["x"] * cos + rate["y"] * sin, rate["y"] * cos - rate["x"] * sin
    return found | {"turning": rate["psi"]}


def driven(kind: str) -> Craft:
    """Return a craft that has driven every manoeuvre, once as it is and once for each coefficient moved."""
    name, limits = CRAFT[kind]
    model = hc.vehicle(name)
    manoeuvres = family(limits, STEP)
    own = runs(model, manoeuvres)
    scale = {c: float(np.sqrt(np.mean([np.mean(r[c] ** 2) for r in own]))) for c in CHANNELS}
    craft = Craft(model, manoeuvres, own, scale, {})
    for key, value in model.coefficients().items():
        if not key.endswith("_width"):
            moved = model.with_coefficients({key: value + 1e-3 * (abs(value) or 1.0)})
            craft.moved[key] = _change(craft, moved)
    return craft


def _change(craft: Craft, model: Model) -> Array:
    """Return by how much a model's runs differ from the craft's, all channels of all manoeuvres."""
    rows = []
    for before, after in zip(craft.runs, runs(model, craft.manoeuvres), strict=True):
        rows += [(after[c] - before[c]) / craft.scale[c] for c in CHANNELS]
    return np.nan_to_num(np.concatenate(rows))


def seen_by(name: str, craft: dict[str, Craft]) -> Seen:
    """Return an effect at a size at which it shows, on the craft of its kind."""
    cls = effect_class(name)
    own = craft["fan" if cls.craft == "fan" else "rudder"]
    e = _sized(cls, own)
    model = _with(own.model, e)
    change = _change(own, model)
    columns = [column for key, column in own.moved.items() if key != name]
    taken, sizes, _ = np.linalg.svd(np.transpose(columns), full_matrices=False)
    taken = taken[:, sizes > 1e-6 * sizes[0]]
    return Seen(own.model, model, e, own, change - taken @ (taken.T @ change))


def _with(model: Model, e: Effect) -> Model:
    """Return a model with an effect, or with other numbers of it where it has it."""
    if e.name in {own.name for own in model.effects}:
        return model.with_coefficients({e.parameter(k): v for k, v in e.values.items()})
    return model.with_effects([e])


def _sized(cls: type[Effect], craft: Craft) -> Effect:
    """Return an effect at a size that changes the motion by about SIZE, within its bounds."""
    has = next((e for e in craft.model.effects if e.name == cls.name), None)
    if has is not None:  # of those that the craft has a little more
        return _grown(has, craft)
    largest = max(float(np.abs(row).max()) for m in craft.manoeuvres for row in list(m.commands.values())[:1])
    units = {"input": largest, "speed": 1.0, "time": 20.0}
    values: dict[str, float] = {}
    for key, number in cls.numbers.items():
        if isinstance(number, Shape) and number.search:
            middle = sorted(number.search)[len(number.search) // 2]
            values[key] = middle * units.get(number.of, 1.0)
        elif number.default is not None and isinstance(number, Shape):
            values[key] = number.default
        else:
            values[key] = number.neutral + 0.05
    scaled = [k for k, n in cls.numbers.items() if not isinstance(n, Shape)]
    for _ in range(2):  # the answer is not quite linear
        if not scaled:
            break
        moved = _change(craft, craft.model.with_effects([cls(**values)]))
        factor = SIZE / max(float(np.sqrt(np.mean(moved**2))), 1e-9)
        for key in scaled:
            number = cls.numbers[key]
            value = number.neutral + factor * (values[key] - number.neutral)
            values[key] = float(np.clip(float(f"{value:.2g}"), number.lower, number.upper))
    return cls(**values)


def _grown(has: Effect, craft: Craft) -> Effect:
    """Return an effect that the craft has, larger by what changes the motion by about SIZE."""
    value = has.values["value"]
    step = 0.1 * (value or 1.0)
    for _ in range(2):
        grown = type(has)(**{**has.values, "value": value + step})
        moved = float(np.sqrt(np.mean(_change(craft, _with(craft.model, grown)) ** 2)))
        step = float(f"{step * SIZE / max(moved, 1e-9):.2g}")
    return type(has)(**{**has.values, "value": value + step})
