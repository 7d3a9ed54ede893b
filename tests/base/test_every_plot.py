"""Every result that has a plot: names and units on all axes, something drawn, places to scale."""

import ast
from pathlib import Path

import control
import numpy as np
import pytest
from matplotlib.figure import Figure

import hovercontrol as hc
from hovercontrol.control.analysis import (
    IssGain,
    Margins,
    Region,
    axis,
    excitation,
    expected_errors,
    loop_margins,
    margins_along,
    observability_gramian,
)
from hovercontrol.control.observers.ins import consistency
from hovercontrol.craft.hardware.actuators import FanTable, ServoTable
from hovercontrol.craft.hardware.calibration import fit_rudder, thrust_table_from_bench
from hovercontrol.documents.scenarios.budget import Budget, Cost
from hovercontrol.documents.scenarios.machine import run_machine
from hovercontrol.identification.diagnose.unknown.function import FittedFunction
from hovercontrol.identification.identify import free_run
from hovercontrol.logs import BenchTable, Log, smooth_pose

PACKAGE = Path(hc.__file__).parent
CRAFT = hc.vehicle("c17_experiment")
T = np.linspace(0.0, 2.0, 101)
LINE = control.tf([4.0, 2.0], [1.0, 2.0, 1.0, 0.0])
GIVEN = {"thrust": 2.0 + np.sin(3 * T), "rudder": 0.2 * np.cos(2 * T)}
SPEEDS = 1e3 * np.arange(3.0, 9.0)


def motion():
    found = hc.simulate(CRAFT.plant(), T, GIVEN, {"u": 0.5, "v": 0.1, "r": 0.2})
    return dict(zip(found.output_labels, found.outputs, strict=True)) | GIVEN


def loop():
    v, a, k = hc.Signal("v", "m/s", start=1.0), hc.Signal("a", "m/s^2"), hc.Signal("k", "1/s", start=2.0)
    cart = hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
    return [cart, hc.Block("law", [], [v], [a], [k], output_expressions={"a": -k.symbol * v.symbol})]


def decay():
    v, k = hc.Signal("v", "m/s", start=1.0), hc.Signal("k", "1/s", start=1.0, lower=0.0)
    return hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})


def replayed():
    v, F = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2")
    cart = hc.Block("cart", [v], [F], [v], derivatives={"v": F.symbol})
    watch = hc.monitor(
        cart, ["v_bias"], false_alarms_per_hour=1.0, period=0.1, measured=["v"],
        process_noise={"v": 0.01}, measurement_noise={"v": 0.01},
    )  # fmt: skip
    t = np.arange(0.0, 30.0, 0.1)
    seen = np.where(t > 20.0, 0.5, 0.0) + np.random.default_rng(1).normal(0.0, 0.01, t.size)
    return hc.replay(watch, Log("cart", t, {"v": seen, "F": 0.0 * t}))


def disc():
    x, y = axis("x", "m", (-1.0, 1.0), 40), axis("y", "m", (-2.0, 2.0), 41)
    X, Y = np.meshgrid(x.values, y.values)
    return Region("a disc", x, y, {"disc": X**2 + Y**2 < 1, "height": X + Y}, units={"height": "m"})


def bench():
    rudder, speed = (
        a.ravel() for a in np.meshgrid([-20.0, 0.0, 20.0], 1e3 * np.arange(3.0, 9.0), indexing="ij")
    )
    rudder, speed = np.append(rudder, np.zeros(6)), np.append(speed, -1e3 * np.arange(6.0, 12.0))
    return thrust_table_from_bench(rudder, speed, np.sign(speed) * (0.015 * (speed / 1e3) ** 2 + 0.01))


def swept(**params):
    return decay().compile().sweep(T, params={f"decay.{k}": v for k, v in params.items()})


def budget():
    half, whole = Cost(np.array([0.4, 0.6])), Cost(np.array([0.9, 1.1]))
    return Budget("k06-real-turn", whole, half, {"brake": half, "tables": whole}, {"brake": half})


def ins():
    rng = np.random.default_rng(2)
    errors, covariances = rng.normal(size=(2, 20, 3)), np.eye(2)[:, :, None, None] * np.ones((20, 3))
    return consistency(errors, covariances)


def blind():
    rows = motion()
    return smooth_pose(Log("blind", T, {k: rows[k] for k in ("x", "y", "psi", "thrust", "rudder")}))


def whole_loop():
    craft = hc.vehicle("c17_simulation")
    parts = [craft.plant(), hc.tracking_controller(craft), hc.ellipse(1.5, 2.5, rate=-1.0)]
    return hc.interconnect(parts).compile().simulate(T)


def residuals():
    k, v, a = hc.Signal("k", "1/s", start=1.0), hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2")
    block = hc.Block("decay", [v], [a], [v], [k], {"v": a.symbol - k.symbol * v.symbol})
    seen = np.exp(-T) + 0.01 * np.random.default_rng(1).normal(size=T.size)
    return hc.identify(block, [Log("decay", T, {"v": seen, "a": 0.0 * T})]).residuals(lags=3)


TABLE = np.array([0.0, 1.0, 2.0]), np.array([0.0, 0.5, 0.7]), np.array([0.01, 0.02, 0.02])

#: How each is made, and the class whose plot draws it.
QUICK = {
    "run": ("Response", lambda: hc.simulate(CRAFT.plant(), T, GIVEN)),
    "compiled run": ("Response", whole_loop),
    "path": ("plot_path", lambda: hc.plot_path(whole_loop())),
    "machine": ("MachineRun", lambda: run_machine(decay(), seconds=1.0)),
    "sweep, curve": ("SweepResult", lambda: swept(k=[0.5, 1.0, 2.0])),
    "sweep, runs": ("SweepResult", lambda: swept(k=[1.0, 1.0])),
    "log": ("Log", lambda: Log("pose", T, {k: motion()[k] for k in ("x", "y", "psi", "u", "v", "r")})),
    "bench table": (
        "BenchTable",
        lambda: BenchTable("esc", np.array([1.1e3, 1.2e3]), np.array([0.1, 0.3]), idle=1e3),
    ),
    "smoothed": ("Smoothed", blind),
    "fan table": (
        "FanTable",
        lambda: FanTable("fan", "force", [-5, 5], [0.0, 1.0], [[0, 9], [0, 8]]),
    ),
    "servo table": ("ServoTable", lambda: ServoTable("servo", [1.0, 1.5, 2.0], [-30.0, 0.0, 35.0])),
    "rudder fit": ("Fit", lambda: fit_rudder(np.arange(5.0), [0.5, -0.8, -2.3, -3.6, -5.0])),
    "fan bench": ("FanCalibration", bench),
    "consistency": ("Consistency", ins),
    "free run": ("FreeRun", lambda: free_run(CRAFT, Log("free", T, motion()))),
    "gain of errors": (
        "IssGain",
        lambda: IssGain(("c1", "c2"), ("m/s^2", "1/s"), {"c1": 1.0, "c2": 2.3}, 3.0, 0.5, 0.9),
    ),
    "region": ("Region", disc),
    "area": ("Region", lambda: disc().plot("disc")),
    "excitation": ("Excitation", lambda: excitation(CRAFT.plant(), T, motion())),
    "gramian": ("Gramian", lambda: observability_gramian(CRAFT.plant(), T, motion(), ["surge_coulomb"])),
    "sliding": (
        "SlidingGramian",
        lambda: observability_gramian(CRAFT.plant(), T, motion(), ["surge_coulomb"]).sliding(1.0),
    ),
    "margins": (
        "Margins",
        lambda: loop_margins(LINE),
    ),
    "bode": ("Bode", lambda: hc.bode(LINE)),
    "nyquist": ("Nyquist", lambda: hc.nyquist(LINE)),
    "sensitivity": ("Sensitivity", lambda: hc.sensitivity(LINE)),
    "margins along": (
        "FrozenMargins",
        lambda: margins_along(loop(), "a", hc.simulate(hc.interconnect(loop()), [0.0, 0.5, 1.0])),
    ),
    "budget": ("Budget", budget),
    "unknown function": ("FittedFunction", lambda: FittedFunction("mu", "C_s", "1/s", "g/L", *TABLE)),
}
SLOW = {
    "residuals": ("Residuals", residuals),
    "replayed": ("Replayed", replayed),
    "expected errors": (
        "ExpectedErrors",
        lambda: expected_errors({"circle": hc.circle(2.0, 0.5)}, hc.vehicle("c17_simulation"), duration=2.0),
    ),
}
#: Made once for all tests of notebooks.
SHARED = {"run": "Run", "varied": "GridResult", "sweep": "SweepResult", "study": "Study",
          "identified": "Identified", "diagnosis": "Diagnosis", "check": "Checked"}  # fmt: skip


def drawn(thing):
    if isinstance(thing, Figure):
        return thing
    found = thing.plot()
    return found.figure if isinstance(found, control.ControlPlot) else found


def all_axes(figure):
    return [a for a in figure.axes if a.get_visible()] + [a for part in figure.subfigs for a in part.axes]


def named(axis):
    """Whether names stand at an axis's ticks."""
    words = [t.get_text() for t in axis.get_ticklabels()]
    return any("$" not in word and any(map(str.isalpha, word)) for word in words)


def complaints(figure):
    figure.canvas.draw()
    found = []
    for a in all_axes(figure):
        if not (a.lines or a.patches or a.collections or a.images):
            found.append("nothing is drawn")
        below = [b.get_xlabel() for b in a.get_shared_x_axes().get_siblings(a)]
        labels = (a.get_xlabel(), *below, getattr(figure, "get_supxlabel", str)())
        if a.get_label() != "<colorbar>" and not any("[" in text for text in labels) and not named(a.xaxis):
            found.append(f"x axis: {a.get_xlabel()!r}")
        if "[" not in a.get_ylabel() and not named(a.yaxis):
            found.append(f"y axis: {a.get_ylabel()!r}")
        if (a.get_xlabel(), a.get_ylabel()) == ("x [m]", "y [m]") and a.get_aspect() != 1.0:
            found.append("a map that is not to scale")
    return found


@pytest.mark.parametrize("name", [*QUICK, *(pytest.param(n, marks=pytest.mark.slow) for n in SLOW)])
def test_its_axes_have_names_and_units(name):
    _, make = (QUICK | SLOW)[name]
    assert complaints(drawn(make())) == []


@pytest.mark.slow("study", "diagnosis", "check", "varied")
@pytest.mark.parametrize("name", SHARED)
def test_axes_of_whole_evaluations_have_names_and_units(results, name):
    assert complaints(drawn(results[name])) == []


def test_every_figure_of_a_scenario_has_names_and_units(results):
    from hovercontrol.documents.scenarios.figures import figures

    for name, figure in figures(results["run"]).items():
        Figure.savefig(figure, "/dev/null", format="png")
        assert complaints(figure) == [], name


def owners():
    """The classes of the package that have a plot, and functions that are one."""
    for path in PACKAGE.rglob("*.py"):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef) and any(
                isinstance(f, ast.FunctionDef) and f.name == "plot" for f in node.body
            ):
                yield node.name


def test_none_is_left_out():
    here = {kind for kind, _ in (QUICK | SLOW).values()} | set(SHARED.values())
    assert set(owners()) - here == set()


def test_margins_without_their_loop_say_so():
    with pytest.raises(hc.InputError, match="no loop to draw"):
        Margins(stable=True).plot()


def test_margins_draw_the_loop_that_they_are_of():
    above, _ = loop_margins(LINE).plot().axes
    rate, gain = above.lines[0].get_data()
    np.testing.assert_allclose(gain, 20 * np.log10(abs(LINE(1j * rate))), atol=1e-9)
