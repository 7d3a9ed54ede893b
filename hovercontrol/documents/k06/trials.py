"""K06's trials of section 6: tables 6.1 to 6.4, simulated (figures 6.7 to 6.12) and real (6.21 to 6.27)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from hovercontrol.analysis.trials import run_trial
from hovercontrol.documents.item import Item, Printed, about, at_least, at_most
from hovercontrol.documents.k06.reverse_error import ASTERN, NOISES, SUSPECTS, VISIBLE, steady_errors
from hovercontrol.scenarios import Run, Scenario, load_scenario, run_scenario
from hovercontrol.scenarios.figures import figures
from hovercontrol.scenarios.measures import measure
from hovercontrol.scenarios.real_figures import comparison

Array = NDArray[np.float64]

#: Seeds of each trial. One run more, K06's, lies between the least and the largest of 39 with probability
#: 38/40 = 95 %. Times and means are medians over them.
SEEDS = 39

NOISE = (
    "the seeds of K06's one run and its force tables. The navigation's errors are the variances of figure "
    "6.2, and no thrust is lost at a turned rudder beyond its cosine"
)
FIELD = (
    "the craft: its yaw friction here is what brings figure 6.24 to 1.75 rad/s. The curves are not in the "
    "text, so that K06's words and the ends of its axes are compared"
)

Measure = Callable[[Path], Mapping[str, float]]
End = tuple[str, str, str, float, float]

#: Figures of the field are drawn up to here at most [s]: figure 6.24 ends at 22 s, 6.25 and 6.26 at 30 s.
FIELD_END = 30.0

UNIT = {"u": "m/s", "v": "m/s", "r": "rad/s", "psi": "rad"}

#: Ends of the axes: loop, signal, end, and the last two ticks there. MATLAB ends an axis at the first tick
#: beyond its curves, so that their extreme lies between these two. Figures 6.7 to 6.10 draw the real and the
#: ideal loop on one axis ("both"). Ends that the start alone decides are left out.
ENDS: Mapping[str, tuple[End, ...]] = {
    "6.7": (
        ("both", "u", "least", -0.8, -0.6),
        ("both", "u", "largest", 0.6, 0.8),
        ("both", "v", "largest", 0.6, 0.8),
        ("both", "r", "least", -1.0, 0.0),
    ),
    "6.8": (
        ("both", "u", "largest", 1.2, 1.4),
        ("both", "v", "least", -0.25, -0.2),
        ("both", "v", "largest", 0.2, 0.25),
        ("both", "r", "least", -0.5, -0.4),
        ("both", "r", "largest", 0.2, 0.3),
    ),
    "6.9": (
        ("both", "u", "least", -0.9, -0.8),
        ("both", "v", "least", -0.4, -0.3),
        ("both", "v", "largest", 0.2, 0.3),
        ("both", "r", "least", -0.5, -0.4),
        ("both", "r", "largest", 0.3, 0.4),
    ),
    "6.10": (
        ("both", "u", "least", -0.3, -0.25),
        ("both", "u", "largest", 0.15, 0.2),
        ("both", "v", "least", -0.25, -0.2),
        ("both", "v", "largest", 0.2, 0.25),
        ("both", "r", "largest", 3.5, 4.0),
    ),
    "6.11": (
        ("real", "u", "least", -1.5, -1.0),
        ("real", "v", "least", -1.5, -1.0),
        ("real", "r", "least", -2.0, 0.0),
        ("ideal", "u", "least", -0.5, 0.0),
        ("ideal", "v", "least", -0.5, 0.0),
        ("ideal", "r", "least", -2.0, 0.0),
    ),
    "6.12": (
        ("real", "u", "least", -0.4, -0.3),
        ("real", "u", "largest", 0.2, 0.3),
        ("real", "v", "least", -0.2, -0.1),
        ("real", "v", "largest", 0.4, 0.5),
        ("real", "r", "least", -1.5, -1.0),
        ("real", "r", "largest", 1.0, 1.5),
        ("real", "psi", "largest", 2.0, 2.5),
        ("ideal", "u", "least", -0.15, -0.1),
        ("ideal", "v", "least", -0.2, -0.1),
        ("ideal", "v", "largest", 0.1, 0.2),
        ("ideal", "r", "least", -1.0, -0.5),
        ("ideal", "r", "largest", 1.0, 1.5),
        ("ideal", "psi", "largest", 1.0, 1.5),
    ),
    "6.21": (("real", "u", "least", -1.0, -0.8), ("real", "v", "largest", 0.8, 1.0)),
    "6.22": (("real", "r", "least", -0.8, -0.6), ("real", "r", "largest", 0.4, 0.6)),
}


def _end_name(loop: str, signal: str, end: str) -> str:
    of = {"real": "real loop: ", "ideal": "ideal loop: ", "both": ""}[loop]
    return f"{of}{end} {signal}, the seed nearest"


def ends(figure: str) -> tuple[Printed, ...]:
    """Return what the axes of a figure say of its curves."""
    return tuple(
        Printed(
            _end_name(loop, signal, end),
            f"the axis ends at {low if end == 'least' else high:g}, a tick beyond "
            f"{high if end == 'least' else low:g}",
            low,
            high,
            UNIT[signal],
        )
        for loop, signal, end, low, high in ENDS[figure]
    )


def nearest(values: Array, low: float, high: float) -> float:
    """Return the value that lies nearest to a range: inside if any is."""
    return float(values[np.abs(values - np.clip(values, low, high)).argmin()])


@lru_cache(maxsize=16)
def simulated(name: str) -> Scenario:
    """Return a scenario; of K06's simulated trials with K06's errors of the navigation and nothing chosen.

    The scenarios ``k06-real-...`` have sensors and filters in full, and a loss of thrust at a turned rudder.
    """
    scenario = load_scenario(name)
    if scenario.autopilot is None or not name.startswith("k06-real-"):
        return scenario
    return replace(scenario, autopilot=replace(scenario.autopilot, navigation="error_model", rudder_loss=0.0))


@lru_cache(maxsize=4)
def run(name: str, own: bool = True) -> Run:
    """Return one run of a scenario, or of K06's simulation of it (`own`)."""
    return run_scenario(simulated(name) if own else load_scenario(name))


@lru_cache(maxsize=16)
def measured(name: str, own: bool = True) -> tuple[Mapping[str, float], Mapping[tuple[str, str, str], Array]]:
    """Return medians over seeds of a trial's metrics, and each seed's extremes by loop, signal and end."""
    scenario = simulated(name) if own else load_scenario(name)
    time, outputs = run_trial(scenario, runs=SEEDS)
    medians = {
        m.name: float(np.median([measure(m, time, values) for values in outputs[m.of]]))
        for m in scenario.metrics
    }
    extremes = {}
    for signal in UNIT:
        for end, pick, of_two in (("least", np.min, np.minimum), ("largest", np.max, np.maximum)):
            real, ideal = (pick(outputs[key], axis=1) for key in (signal, f"ideal_{signal}"))
            extremes["real", signal, end] = real
            extremes["ideal", signal, end] = ideal
            extremes["both", signal, end] = of_two(real, ideal)
    return medians, extremes


def table(name: str) -> Measure:
    """Return the initial velocities, reference and gains of a trial.

    [K06 table 6.1, 6.2, 6.3, 6.4]
    """

    def measure(folder: Path) -> Mapping[str, float]:
        scenario = load_scenario(name)
        gains = {key: value for key, value in (scenario.controller or {}).items() if key != "kind"}
        start = {key: scenario.start.get(key, 0.0) for key in "uvr"}
        values = {**start, **scenario.phases[0].setpoints, **gains}
        lines = [f"{key},{value:g}\n" for key, value in values.items()]
        (folder / "parameters.csv").write_text("parameter,value\n" + "".join(lines), encoding="utf-8")
        return values

    return measure


def _picture(name: str) -> Figure:
    """Return a simulated trial beside the ideal loop; one of the field beside the craft without friction."""
    if name.startswith("k06-field-"):
        return _field_picture(load_scenario(name))
    return figures(run(name))["comparison"]


def _field_picture(scenario: Scenario) -> Figure:
    """Return the first phase of a field trial, real and simulated, as K06's figures 6.21 to 6.26."""
    first = replace(scenario.phases[0], until=min(scenario.phases[0].until, FIELD_END))
    real = replace(scenario, phases=(first,), metrics=())
    return comparison(run_scenario(real), run_scenario(replace(real, plant=real.belief)))


def trial(figure: str, *names: str) -> Measure:
    """Return what draws trials of the real loop beside the ideal one, and measures them over seeds.

    [K06 fig 6.7, 6.8, 6.9, 6.10, 6.11, 6.12] and, of the field, [K06 fig 6.21, 6.22, 6.25, 6.26]
    """

    def measure_trial(folder: Path) -> Mapping[str, float]:
        values: dict[str, float] = {}
        for name in names:
            label = f"{name.partition('heading-')[2]}: " if len(names) > 1 else ""
            _picture(name).savefig(folder / f"{name}.png", dpi=130)
            values |= {f"{label}{key}": value for key, value in measured(name)[0].items()}
            if "ideal_psi" in run(name).columns and "heading_ref" in run(name).columns:
                c, late = run(name).columns, run(name).time > run(name).time[-1] - 10.0
                off = np.angle(np.exp(1j * (c["ideal_psi"] - c["heading_ref"])))[late]
                values[f"{label}heading error of the ideal loop"] = float(np.abs(off).max())
        for loop, signal, end, low, high in ENDS.get(figure, ()):
            both = [measured(name)[1][loop, signal, end] for name in names]
            extreme = np.min(both, axis=0) if end == "least" else np.max(both, axis=0)
            values[_end_name(loop, signal, end)] = nearest(extreme, low, high)
            values[f"{_end_name(loop, signal, end).partition(',')[0]}, median"] = float(np.median(extreme))
        return values

    return measure_trial


def units(*names: str) -> Mapping[str, str]:
    """Return the units of what :func:`trial` measures."""
    found: dict[str, str] = {}
    for name in names:
        label = f"{name.partition('heading-')[2]}: " if len(names) > 1 else ""
        found |= {f"{label}{m.name}": m.unit for m in load_scenario(name).metrics}
        found[f"{label}heading error of the ideal loop"] = "rad"
    for loop in ("real", "ideal", "both"):
        for signal, unit in UNIT.items():
            for end in ("least", "largest"):
                found[f"{_end_name(loop, signal, end).partition(',')[0]}, median"] = unit
    return found


def beside_simulation(figure: str, field: str, without: str, *keys: str) -> Measure:
    """Return what draws a field trial and measures it less the same loop with a craft without friction."""

    def measure_both(folder: Path) -> Mapping[str, float]:
        values = dict(trial(figure, field)(folder))
        plain = measured(without, own=False)[0]
        return values | {f"{key}: real less simulated": values[key] - plain[key] for key in keys}

    return measure_both


def fig_6_23(folder: Path) -> Mapping[str, float]:
    """Steady error astern with a dead zone of the fan, by two models of the noise [K06 fig 6.23]."""
    names = ("nothing", "dead zone of the fan, 0.2 N")
    suspect = SUSPECTS[names[1]].fitted_to(load_scenario("k06-real-reverse"))
    _field_picture(suspect).savefig(folder / "dead_zone.png", dpi=130)
    values: dict[str, float] = {}
    for noise, navigation in NOISES.items():
        nothing, dead = steady_errors({n: SUSPECTS[n] for n in names}, runs=6, navigation=navigation)
        ahead = float(dead.ahead.mean() - nothing.ahead.mean())
        values[f"error ahead beyond the simulation's, {noise}"] = abs(ahead)
        for ref, own, base in zip(ASTERN, dead.astern, nothing.astern, strict=True):
            more = abs(own.mean()) - abs(base.mean())
            values[f"error at {ref:g} m/s beyond the simulation's, {noise}"] = float(more)
    return values


def fig_6_24(folder: Path) -> Mapping[str, float]:
    """Turn of a craft with yaw friction, by the whole loop [K06 fig 6.24]."""
    real, own = run("k06-field-real-turn"), run("k06-real-turn", own=False)
    _field_picture(real.scenario).savefig(folder / "comparison.png", dpi=130)
    values = {m.metric.name: m.value for m in real.metrics()}
    rate = own.columns["true_r"]
    first = own.time[np.argmax(rate >= 0.95 * 3.0)]
    return values | {"later than simulated": values["time until 95 % of 1.75 rad/s"] - float(first)}


def fig_6_27(folder: Path) -> Mapping[str, float]:
    """Draw both headings of the field in one picture [K06 fig 6.27]."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    axes = figure.subplots()
    values = {}
    for kind, style in (("bangbang", "-"), ("proportional", "--")):
        own = run(f"k06-field-heading-{kind}")
        heading = np.mod(own.columns["true_psi"], 2 * math.pi)
        heading[1:][np.abs(np.diff(heading)) > math.pi] = np.nan
        axes.plot(own.time, heading, style, label=kind)
        late = own.time > 20.0
        off = np.angle(np.exp(1j * (own.columns["true_psi"] - 0.5 * math.pi)))[late]
        values[f"{kind}: rms heading error from 20 s [rad]"] = float(np.sqrt(np.mean(off**2)))
    axes.axhline(0.5 * math.pi, color="0.6", ls=":", label="goal, 90 deg")
    axes.set(xlabel="time [s]", ylabel="heading [rad]", ylim=(0.0, 7.0))
    axes.legend(frameon=False)
    figure.savefig(folder / "headings.png", dpi=130)
    return values


#: Of a trial's parameters; K06 prints none for the gains.
_UNITS = {"u": "m/s", "v": "m/s", "r": "rad/s", "surge_ref": "m/s", "yaw_rate_ref": "rad/s"}


def _table(number: str, law: str, printed: Mapping[str, float]) -> Item:
    rows = tuple(
        about(key, value, 5e-3 * max(abs(value), 1.0), _UNITS.get(key, "")) for key, value in printed.items()
    )
    return Item("k06", "table", number, f"parameters of the {law} trial", table(f"k06-{law}"), rows)


_DEGREE = math.radians(1.0)
_OFF = "heading error of the ideal loop"
_TOLERANCE = about(
    f"bangbang: {_OFF}", _DEGREE, 0.1 * _DEGREE, "rad", text="chatters at its tolerance, 1 deg"
)
_BEYOND = at_least(f"proportional: {_OFF}", _DEGREE, "rad", text="a steady-state error, beyond 1 deg")

ITEMS = [
    _table("6.1", "stop", {"u": 0.2, "v": -0.7, "r": 6.4, "k1": 1.0, "k2": 2.5}),
    Item(
        "k06",
        "fig",
        "6.7",
        "stop, simulated real loop",
        trial("6.7", "k06-real-stop"),
        (
            about(
                "time until the surge stays within 0.1 m/s",
                10.0,
                2.0,
                "s",
                text="roughly 10 s",
                fitted="by the band that counts as rest, two standard deviations of the noise at the end",
            ),
            *ends("6.7"),
        ),
        lacks=NOISE,
        units=partial(units, "k06-real-stop"),
    ),
    _table("6.2", "forward", {"u": 0.0, "v": 0.0, "r": 0.0, "surge_ref": 1.1, "k1": 1.0, "k2": 4.0}),
    Item(
        "k06",
        "fig",
        "6.8",
        "forward at 1.1 m/s, simulated real loop",
        trial("6.8", "k06-real-forward"),
        (
            about("time until 1.1 m/s for the first time", 5.0, 1.0, "s", text="about 5 s"),
            about(
                "surge from 8 s, farthest from 1.1 m/s", 0.1, 0.05, "m/s", text="fluctuates between +-0.1 m/s"
            ),
            *ends("6.8"),
        ),
        lacks=NOISE,
        units=partial(units, "k06-real-forward"),
    ),
    _table(
        "6.3",
        "reverse",
        {"u": 0.0, "v": -0.1, "r": 0.1, "surge_ref": -0.76, "k1": 1.5, "k2": 1.0, "alpha": 1.44},
    ),
    Item(
        "k06",
        "fig",
        "6.9",
        "reverse at 0.76 m/s, simulated real loop",
        trial("6.9", "k06-real-reverse"),
        (
            about("time until -0.71 m/s, 0.05 from what is told", 5.0, 1.0, "s", text="roughly five seconds"),
            *ends("6.9"),
        ),
        lacks=NOISE,
        units=partial(units, "k06-real-reverse"),
    ),
    _table("6.4", "turn", {"u": 0.0, "v": 0.0, "r": 0.1, "yaw_rate_ref": 3.0, "k1": 0.5, "k2": 3.5}),
    Item(
        "k06",
        "fig",
        "6.10",
        "turn at 3 rad/s, simulated real loop",
        trial("6.10", "k06-real-turn"),
        (about("yaw rate, mean", 3.0, 0.1, "rad/s", text="oscillates about 3 rad/s"), *ends("6.10")),
        lacks=NOISE,
        units=partial(units, "k06-real-turn"),
    ),
    Item(
        "k06",
        "fig",
        "6.11",
        "heading to 5 rad, both laws",
        trial("6.11", "k06-real-heading-bangbang", "k06-real-heading-proportional"),
        (_TOLERANCE, _BEYOND, *ends("6.11")),
        lacks=NOISE
        + "; figures of the real loop's headings at their end. The initial velocities are read off "
        "the upper ends of the axes",
        units=partial(units, "k06-real-heading-bangbang", "k06-real-heading-proportional"),
    ),
    Item(
        "k06",
        "fig",
        "6.12",
        "heading from rest to 1 rad, both laws",
        trial("6.12", "k06-real-heading-bangbang-rest", "k06-real-heading-proportional-rest"),
        (
            replace(_TOLERANCE, name=f"bangbang-rest: {_OFF}"),
            replace(_BEYOND, name=f"proportional-rest: {_OFF}"),
            *ends("6.12"),
        ),
        lacks=NOISE + "; figures of the real loop's headings at their end",
        why="not known. K06's ideal loop backs at more than 0.1 m/s, ours at 0.084; in all our runs the real "
        "craft slides less than K06's to the left",
        units=partial(units, "k06-real-heading-bangbang-rest", "k06-real-heading-proportional-rest"),
    ),
    Item(
        "k06",
        "fig",
        "6.21",
        "stop, real craft",
        beside_simulation(
            "6.21", "k06-field-stop", "k06-real-stop", "time until the yaw rate stays within 0.3 rad/s"
        ),
        (
            at_most(
                "time until the yaw rate stays within 0.3 rad/s: real less simulated",
                0.0,
                "s",
                text="faster than predicted by the simulation",
            ),
            *ends("6.21"),
        ),
        lacks=FIELD,
        why="not known: from table 6.1's start neither our craft with yaw friction nor the one without comes "
        "to 0.8 m/s",
    ),
    Item(
        "k06",
        "fig",
        "6.22",
        "forward at 1.1 m/s, real craft",
        beside_simulation(
            "6.22", "k06-field-forward", "k06-real-forward", "time until 1.0 m/s", "sway from 8 s, largest"
        ),
        (
            about(
                "time until 1.0 m/s: real less simulated",
                0.0,
                0.5,
                "s",
                text="transients practically identical",
            ),
            *ends("6.22"),
        ),
        lacks=FIELD,
        why="our real loop has the noise of K06's sensors and filters as stated, which is too small on the "
        "rotating bench, too (table 6.7)",
    ),
    Item(
        "k06",
        "fig",
        "6.23",
        "reverse at 0.76 m/s, real craft",
        fig_6_23,
        (
            *(
                at_most(
                    f"error ahead beyond the simulation's, {noise}",
                    VISIBLE,
                    "m/s",
                    text="ahead the agreement is excellent",
                    fitted="the suspect is chosen so",
                )
                for noise in NOISES
            ),
            *(
                at_least(
                    f"error at {ref:g} m/s beyond the simulation's, {noise}",
                    VISIBLE,
                    "m/s",
                    text="a nontrivial steady-state error, at any reference",
                    fitted=fitted,
                )
                for noise, fitted in zip(NOISES, ("the suspect is chosen so", ""), strict=True)
                for ref in ASTERN
            ),
        ),
        lacks="the size of the error",
        why="a dead zone of the fan is one candidate, and it depends on the noise: of nine suspects it alone "
        "leaves an error at each reference astern and none ahead with sensors and filters in full; with the "
        "variances that K06 prints noise carries the command across the dead zone, and none of the nine does "
        "(analyze k06_reverse_error)",
    ),
    Item(
        "k06",
        "fig",
        "6.24",
        "turn told 3 rad/s, real craft",
        fig_6_24,
        (
            about(
                "yaw rate, told 3 rad/s",
                1.75,
                0.05,
                "rad/s",
                text="approximately 1.75 rad/s",
                fitted="by the yaw friction, 0.72 1/s",
            ),
            at_most("sway velocity there", 0.0, "m/s", text="a small negative bias"),
            about("later than simulated", 2.0, 1.0, "s", text="about 2 s longer"),
        ),
        lacks=FIELD,
        why="with linear yaw friction the craft is at its own, lower rate no later than without; K06's curve "
        "rises more slowly, for which no cause is known",
    ),
    Item(
        "k06",
        "fig",
        "6.25",
        "bang-bang heading to 90 deg, real craft",
        trial("6.25", "k06-field-heading-bangbang"),
        lacks=FIELD,
        units=partial(units, "k06-field-heading-bangbang"),
    ),
    Item(
        "k06",
        "fig",
        "6.26",
        "proportional heading to 90 deg, real craft",
        trial("6.26", "k06-field-heading-proportional"),
        lacks=FIELD,
        units=partial(units, "k06-field-heading-proportional"),
    ),
    Item("k06", "fig", "6.27", "both headings, real craft", fig_6_27, lacks=FIELD),
]
