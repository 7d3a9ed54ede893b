"""A public function refuses an argument of a wrong type, number or shape in one line."""

from random import Random

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.core.annotations import described, fits
from hovercontrol.core.boundary import checked
from hovercontrol.errors import InputError
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


def test_what_is_right_passes_and_what_is_too_much_is_pythons():
    assert steer(1, ["a"]) == 1.5
    with pytest.raises(TypeError, match="unexpected keyword"):
        steer(1.0, [], speed=1)


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
        ((-1, [1.0]), "crawl: points: expected zero or more, found -1"),
        ((1, [np.nan]), "crawl: speed: expected finite numbers, found [nan]"),
        ((1, []), "crawl: speed: expected at least one value, found []"),
        ((1, np.ones((2, 3))), "crawl: expected shapes that go together, found speed (2, 3)"),
    ],
)
def test_a_stumble_over_a_number_or_a_shape_says_so(arguments, said):
    @checked
    def crawl(points: int, speed: "np.ndarray") -> object:
        if not np.all(np.isfinite(speed)) or not np.size(speed):
            raise ValueError("deep inside")
        return (
            np.zeros(points) @ np.asarray(speed).reshape(-1) if np.ndim(speed) == 1 else np.zeros(4) + speed
        )

    with pytest.raises(InputError) as error:
        crawl(*arguments)
    assert str(error.value) == said


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


def test_hostile_calls_of_public_functions_are_refused_in_one_line():
    counts = {0: 0, 2: 0}
    for seed in range(600):
        counts[call(some_call(Random(seed)))] += 1
    assert counts[2] > 300
