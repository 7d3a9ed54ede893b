"""A public function refuses an argument of a wrong type, number or shape in one line."""

import dataclasses
import functools
from concurrent.futures import ThreadPoolExecutor
from random import Random

import numpy as np
import numpy.typing as npt
import pytest

import hovercontrol as hc
from hovercontrol.base.annotations import described, fits
from hovercontrol.base.boundary import as_user, checked, fault_of
from hovercontrol.base.errors import InputError
from hovercontrol.logs import Log
from tests.fuzz.calls import some_call
from tests.fuzz.judge import call


@checked
def steer(rate: float, names: "list[str]", craft: hc.Model | None = None, *, hold: bool = True) -> float:
    return rate / 2 + len([name.upper() for name in names])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("fast", []), "steer: rate: expected a number, found 'fast'"),
        ((1.0, 3), "steer: names: expected a sequence, each a text, found 3"),
        ((1.0, [1]), "steer: names[0]: expected a text, found 1"),
        ((None, []), "steer: rate: expected a number, found None"),
    ],
)
def test_one_line_says_function_argument_expected_and_found(arguments, said):
    with pytest.raises(InputError) as error:
        steer(*arguments)
    assert str(error.value) == said


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda: steer(1.0, [], hald=True),
            "steer: got an unexpected keyword argument 'hald'; did you mean 'hold'?",
        ),
        (
            lambda: steer(1.0),
            "steer: missing required argument: 'names'; arguments: rate, names, craft, hold",
        ),
        (
            lambda: steer(hold=True),
            "steer: missing required arguments: 'rate', 'names'; arguments: rate, names, craft, hold",
        ),
        (
            lambda: steer(1.0, [], None, True),
            "steer: too many positional arguments; arguments: rate, names, craft, hold",
        ),
    ],
)
def test_a_call_with_a_wrong_argument_is_one_line_with_the_names(call, said):
    assert steer(1, ["a"]) == 1.5
    with pytest.raises(TypeError) as error:
        call()
    assert str(error.value) == said and isinstance(error.value, InputError)


def test_an_argument_in_anothers_place_is_told_its_place():
    with pytest.raises(InputError, match=r"craft: expected a Model or None, .*; did you mean names=...\?"):
        steer(1.0, [], ["left"])


def test_a_stumble_over_right_arguments_is_not_hidden():
    @checked
    def ours(rate: float) -> float:
        raise KeyError("a fault of ours")

    with pytest.raises(KeyError):
        ours(1.0)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((10**400, [1.0]), "crawl: points: expected numbers of a usual size, found a number of 401 digits"),
        ((1, [np.nan]), "crawl: speed: expected finite numbers, found [nan]"),
        ((1, np.array([np.inf])), "crawl: speed: expected finite numbers, found array([inf])"),
        ((1, []), "crawl: speed: expected at least one value, found []"),
    ],
)
def test_a_stumble_over_a_number_says_so(arguments, said):
    with pytest.raises(InputError) as error:
        crawl(*arguments)
    assert str(error.value) == said
    with pytest.raises((ValueError, ArithmeticError)) as error:  # not where the package gave it
        in_package(crawl, *arguments)
    assert not isinstance(error.value, InputError)


@checked
def crawl(points: int, speed: "np.ndarray") -> object:
    if not np.all(np.isfinite(speed)) or not np.size(speed):
        raise ValueError("deep inside")
    return np.zeros(points) @ np.asarray(speed)


#: A module of the package that calls what it is given.
CALLER: dict = {}
exec(
    compile(
        "def in_package(thing, *a, **k): return thing(*a, **k)",
        hc.__file__.replace("__init__", "inside"),
        "exec",
    ),
    CALLER,
)
in_package = CALLER["in_package"]


def test_a_wrong_argument_of_the_packages_own_call_is_no_fault_of_the_user():
    with pytest.raises(TypeError, match="steer: rate: expected a number, found 'fast'"):
        in_package(steer, "fast", [])
    with pytest.raises(TypeError, match="found 'fast'"):
        in_package(functools.partial(steer, names=[]), "fast")
    with pytest.raises(
        InputError, match="found 'fast'"
    ):  # but it is where the package hands on what he gives
        in_package(as_user, steer, "fast", [])
    with pytest.raises(InputError, match="found 'fast'"):  # and where a file of his is at work
        in_package(lambda: steer("fast", []))


def test_what_a_library_calls_is_its_callers_call():
    part = functools.partial(steer, names=[])
    with ThreadPoolExecutor(1) as pool, pytest.raises(InputError, match="found 'fast'"):
        pool.submit(lambda: part("fast")).result()
    with pytest.raises(InputError, match="name: expected a text, found 2"):
        dataclasses.replace(hc.Signal("v", "m/s"), name=2)
    with pytest.raises(InputError, match="name: expected a text, found 2"):
        hc.Signal("v", "m/s").replace(name=2)
    with pytest.raises(TypeError, match="name: expected a text, found 2"):
        in_package(dataclasses.replace, hc.Signal("v", "m/s"), name=2)


@pytest.mark.parametrize(
    "error",
    [TypeError("x"), KeyError("x"), ValueError("shapes (2,) and (3,) do not broadcast"), IndexError("x")],
)
def test_an_error_of_the_package_passes_as_it_is_whatever_it_is_told_of(error):
    """Arguments that look odd, or a message about shapes, do not make it the user's."""

    @checked
    def ours(logs: "list[Log]", size: "np.ndarray", times: int = 1) -> None:
        raise error

    log = Log("a", [0.0, 1.0], {"u": [np.nan, 1.0]})
    with pytest.raises(type(error)) as raised:
        ours([log], np.ones((2, 3)), -3)
    assert raised.value is error


def test_a_fault_is_looked_for_in_numbers_alone():
    class Loud:
        def __getattr__(self, name):
            raise AssertionError(f"{name} of an argument is asked for")

    assert fault_of([Loud(), Loud()]) == "" == fault_of({"a": (Loud(),)})
    assert fault_of([[1.0], [np.nan]]) == "finite numbers" == fault_of({"a": np.array([np.inf])})


@checked
class Hovercraft:
    def __init__(self, mass: float) -> None:
        self.mass = mass

    def weigh(self, *stones: str) -> float:
        return self.mass + len(stones)

    @classmethod
    def heavy(cls, times: int) -> "Hovercraft":
        return cls(10.0 * times)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: Hovercraft("2"), "Hovercraft: mass: expected a number, found '2'"),
        (lambda: Hovercraft(2.0).weigh("a", 3), "Hovercraft.weigh: stones: expected a text, found 3"),
        (lambda: Hovercraft.heavy(1.5), "Hovercraft.heavy: times: expected a whole number, found 1.5"),
    ],
)
def test_a_class_checks_its_constructor_and_its_methods(call, said):
    with pytest.raises(InputError) as error:
        call()
    assert str(error.value) == said
    assert Hovercraft.heavy(2).weigh("a") == 21.0


def test_hints_and_values():
    log = Log("a", [0.0], {})
    for value, hint, right in (
        (np.float32(1), float, True), (True, float, False), (10**400, float, False), (1, bool, False),
        (np.int64(3), int, True), ("a", hc.Model | None, False), (None, hc.Model | None, True),
        (log, Log, True),
        ([1, "a"], list[int], False), ((1, 2), tuple[int, ...], True), ({"a": 1}, dict[str, float], True),
        ({1: 1}, dict[str, float], False), (np.zeros(3), np.ndarray, True), ("1", np.ndarray, False),
    ):  # fmt: skip
        assert fits(value, hint) is right, (value, hint)
    assert described(hc.Model | None) == "a Model or None"


def test_what_is_like_an_array_is_numbers_whatever_numpy_makes_of_its_name():
    for hint in (npt.ArrayLike, npt.ArrayLike | None, dict[str, npt.ArrayLike] | npt.ArrayLike | None):
        assert fits([1, 2], hint) and fits(np.zeros(3), hint) and fits(2.5, hint)
        assert not fits("nonsense", hint) and not fits([[1.0], [2.0, 3.0]], hint) and not fits(object(), hint)
    assert described(npt.ArrayLike | None) == "numbers or None"


def test_hostile_calls_of_public_functions_are_refused_in_one_line():
    counts = {0: 0, 2: 0}
    for seed in range(600):
        counts[call(some_call(Random(seed)))] += 1
    assert counts[2] > 300
