"""What results show at the prompt: a few lines, whatever they hold. What is hashed or compared stays."""

import copy
import dataclasses
import importlib
import pickle
import pkgutil
import re
import sys
from types import SimpleNamespace

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.short_repr import short, short_repr
from hovercontrol.blocks.delays import registers
from hovercontrol.control.analysis import Axis, Region
from hovercontrol.craft.effects import effect
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts
from hovercontrol.identification.identify.study import Study

#: What users write themselves shows as the call that makes it.
WRITTEN = {"Beacons", "BoundedDelays", "Condition", "Imperfections", "Printed", "Signal"}
#: Namesakes in the package of what is returned: an alias of NDArray, a callable, a rival's, pyarrow's table.
OTHERS = {"Array", "Report", "Residuals", "Table"}
LINES, WIDTH = 12, 120


def loop():
    return hc.interconnect(list(loop_parts(load_scenario("table1")).values()), "loop")


def held():
    late = hc.vehicle("hoverdemon").with_effects([effect("input_delay", seconds=0.1)]).plant()
    return registers(late, 0.05)


def sweep():
    k = np.linspace(0.5, 1.0, 40)
    ready = hc.vehicle("c17_simulation").plant().compile()
    return ready.sweep(np.linspace(0, 1, 11), params={"plant.yaw_coulomb": k}, method="rk4", step=0.01)


def region():
    axes = Axis("k1", "1/s^2", np.linspace(0, 3, 31)), Axis("k2", "1/s", np.linspace(0, 2, 21))
    maps = {"stable": np.eye(21, 31) > 0, "rate": np.arange(651.0).reshape(21, 31)}
    return Region("stable gains", *axes, maps)


def log():
    return hc.Log("demo", np.arange(900.0), {name: np.arange(900.0) for name in ("x", "y", "psi", "thrust")})


def study():
    class Found:
        def __repr__(self):
            return "the table"

    judged = (SimpleNamespace(label="a.csv", holdout=False), SimpleNamespace(label="b.csv", holdout=True))
    return Study(Found(), judged)


PLANT = hc.vehicle("c17_simulation").plant()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: PLANT, ["Block 'plant': 6 states, 2 inputs, 6 outputs, 11 parameters", "u [m/s]", "8 more"]),
        (loop, ["Block 'loop': 83 states, 0 inputs", "plant.psi [rad]", "... 78 more"]),
        (held, ["Block 'plant'", "ticks every 0.05 s"]),
        (lambda: hc.vehicle("c17_simulation"), ["Model 'c17_simulation': 8 effects", "thrust(value=0.75)"]),
        (lambda: hc.vehicle("four_fan"), ["Model 'four_fan'", "4 fans"]),
        (lambda: hc.BlockModel(PLANT), ["BlockModel of Block 'plant': 6 states"]),
        (PLANT.compile, ["CompiledBlock", "smooth friction", "Block 'plant': 6 states"]),
        (PLANT.to_numpy, ["NumpyFunctions of Block 'plant'"]),
        (PLANT.start, ["BlockRunner of block 'plant' at t = 0 s: 2 inputs, 6 states, 6 outputs"]),
        (lambda: PLANT.start().save(), ["Snapshot(", "time=0"]),
        (sweep, ["SweepResult: 40 runs, 0 failed", "plant.yaw_coulomb [rad/s^2] [40 from 0.5 to 1]"]),
        (lambda: sweep()["u"], ["Figures(", "rms=[40 from"]),
        (region, ["'stable gains'", "k1", "[31 from 0 to 3]", "rate: [21 x 31 from 0 to 650]", "3 % true"]),
        (lambda: hc.check(None, [log()]), ["Checked: 1 logs, 0 errors", "checked.text()"]),
        (study, ["Study of 2 logs: a.csv, b.csv (held out)", "the table"]),
        (log, ["Log 'demo': 900 rows from 0 to 899 s", "x, y, psi, thrust"]),
    ],
)  # fmt: skip
def test_what_is_shown_is_a_few_lines_that_name_what_is_there(make, said):
    for text in (repr(make()), str(make())):
        lines = text.split("\n")
        assert len(lines) <= LINES and max(map(len, lines)) <= WIDTH, text
        for part in said:
            assert part in text
        assert "object at 0x" not in text and "array(" not in text


def public():
    """Every function and class in an `__all__` of the package."""
    yield from (getattr(hc, name) for name in hc.__all__)
    for module in pkgutil.walk_packages(hc.__path__, "hovercontrol."):
        if not module.name.endswith("__main__"):
            loaded = importlib.import_module(module.name)
            yield from (getattr(loaded, name) for name in getattr(loaded, "__all__", ()))


def results():
    """Classes of the package that a public function or method returns."""
    things = list(public())
    methods = [
        getattr(getattr(value, "__func__", value), "fget", None) or getattr(value, "__func__", value)
        for thing in things
        if isinstance(thing, type)
        for name, value in vars(thing).items()
        if not name.startswith("_")
    ]
    named: dict[str, list[type]] = {}
    for name, module in list(sys.modules.items()):
        for thing in vars(module).values() if name.startswith("hovercontrol.") else ():
            if isinstance(thing, type) and thing.__module__ == name:
                named.setdefault(thing.__name__, []).append(thing)
    for thing in (*things, *methods):
        if callable(thing) and not isinstance(thing, type):
            space = vars(sys.modules[thing.__module__])
            for word in re.findall(r"\w+", str(getattr(thing, "__annotations__", {}).get("return", ""))):
                one = space.get(word)  # a name that is imported for types alone is looked up in the package
                yield from [one] if isinstance(one, type) and word in named else named.get(word, ())


def test_no_public_result_shows_its_fields_in_full():
    """A dataclass writes its fields in full by itself; that method is marked as wrapped."""
    found = set(results())
    assert len(found) > 80
    raw = {
        one.__name__
        for one in found
        if one.__str__ is object.__str__
        and (hasattr(one.__repr__, "__wrapped__") or one.__repr__ is object.__repr__)
    }
    assert raw == WRITTEN | OTHERS


def test_margins_are_a_table_with_units():
    k, x, e = hc.Signal("k", "1/s", start=2.0), hc.Signal("x", "m"), hc.Signal("e", "m")
    plant = hc.Block("plant", [x], [e], [x], [k], {"x": k.symbol * e.symbol})
    law = hc.Block("law", inputs=[x], outputs=[e], output_expressions={"e": -x.symbol})
    lines = str(hc.margins([plant, law], "e")).splitlines()  # of k/s: 90 deg at k, every gain is borne
    assert lines[0] == "the loop is stable; outside the loop every mode decays"
    table = {name: rest for name, *rest in map(str.split, lines[1:])}
    assert table["phase"] == ["90", "deg"] and table["crossover"] == ["2", "rad/s"]
    assert table["gain_up"] == ["inf", "1"] and table["delay"] == ["0.7854", "s"]


def test_an_animation_is_a_line():
    line = hc.Log("line", [0.0, 2.0], {"x": [0.0, 1.0], "y": [0.0, 0.0], "psi": [0.0, 0.0]})
    text = str(hc.animate(line, fps=10.0))
    assert text.startswith("Animation of line: 21 frames from 0 to 2 s, 10 a second") and "\n" not in text


def test_equality_hashes_and_pickles_are_as_before():
    twin = pickle.loads(pickle.dumps(PLANT))
    assert twin == PLANT and hash(twin) == hash(PLANT) and twin.content_hash == PLANT.content_hash
    assert copy.deepcopy(hc.vehicle("four_fan")) == hc.vehicle("four_fan")
    # What a Block's hash is made of is written in full: cached libraries and checkpoints depend on it.
    assert repr(PLANT.states[0]).startswith("Signal(name='x', unit='m', description=")
    assert repr(held().ticks[0]).startswith("Tick(name=") and "updates=Expressions(" in repr(held().ticks[0])


def test_other_start_values_have_another_hash_though_they_show_alike():
    other = PLANT.with_values({"u": 1.0})
    assert repr(other) == repr(PLANT)
    assert other.content_hash != PLANT.content_hash


def test_a_block_in_an_error_line_is_on_one_line():
    with pytest.raises(hc.InputError) as refused:
        hc.tracking_controller(PLANT)
    assert "\n" not in str(refused.value) and "Block 'plant'" in str(refused.value)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.array([1.0, 2.5, np.nan]), "[1 2.5 nan]"),
        (np.array([[1.0, np.nan], [3.0, -np.inf]]), "[2 x 2 from 1 to 3, 2 not finite]"),
        (np.full(9, np.nan), "[9, 9 not finite]"),
        (np.zeros((0, 3)), "[0 x 3]"),
        (np.array(["a", "b"]), "[2]"),
        (np.arange(9), "[9 from 0 to 8]"),
        (np.float64(0.1), "0.1"),
        (True, "True"),
        ((1.0,), "(1,)"),
        ({"k": [0.5, "a"]}, "{k: [0.5, 'a']}"),
        (None, "None"),
    ],
)
def test_values_in_a_few_words(value, text):
    assert short(value) == text


def test_a_long_result_takes_a_line_for_each_field():
    @dataclasses.dataclass
    class Run:
        name: str
        first: np.ndarray
        second: np.ndarray
        note: str = ""
        hidden: int = dataclasses.field(default=1, repr=False)
        __repr__ = short_repr

    long = Run("a" * 60, np.arange(1000.0), np.arange(2000.0).reshape(2, 1000))
    lines = repr(long).split("\n")
    assert lines[0].endswith("Run(") and lines[-1] == ")"
    assert lines[2] == "    first=[1000 from 0 to 999],"
    assert len(lines) == 5
