"""What no annotation says of arguments, shapes and counts, is checked where a user calls."""

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.control.analysis.directions import Direction
from hovercontrol.control.analysis.excitation import excitation
from hovercontrol.control.analysis.iss import simulated_errors
from hovercontrol.craft.hardware.actuators import fan_force, fan_tables, rudder_of_force_angle
from hovercontrol.craft.hardware.sensors import Beacons, locate, speed_of_sound
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.identify import identify
from hovercontrol.logs import Log
from hovercontrol.logs.clock import fit_clock

CRAFT = hc.vehicle("c17_simulation")
T = np.linspace(0.0, 1.0, 11)
LOG = Log("a", T, dict.fromkeys(("x", "y", "psi", "thrust", "rudder"), T))
SQUARE = Beacons([(0, 0), (2, 0), (2, 2), (0, 2)], 2.0)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: fan_force(np.ones(4), np.ones((2, 3))), "found speed (4,), rudder (2, 3)"),
        (lambda: speed_of_sound([20.0, 21.0], humidity=np.ones((2, 3))), "humidity (2, 3)"),
        (lambda: fan_tables(rudder=2.5), "rudder: expected a row of numbers, found shape ()"),
        (lambda: fit_clock(2.5), "fit_clock: arrival: expected a row of numbers, found shape ()"),
        (lambda: excitation(CRAFT.plant(), 2.5, {"u": 2.0}), "time: expected a row of numbers"),
        (lambda: Direction.of({"a": "m"}, np.ones(2), np.ones(1)), "vector: expected 1 numbers"),
        (lambda: locate([2.5] * 4, SQUARE, previous=np.ones((2, 3))), "previous: expected x and y"),
        (lambda: simulated_errors(CRAFT, [0.1], runs=-3), "runs: expected 1 or more, found -3"),
        (lambda: diagnose(CRAFT, [LOG], seed=-3), "seed: expected 0 or more, found -3"),
        (lambda: identify(CRAFT, [LOG], most_rows=-3), "most_rows: expected 1 or more, found -3"),
        (lambda: CRAFT.plant().parameter_values(3), "expected names, each with a number, found 3"),
        (
            lambda: CRAFT.plant().parameter_values({"plant.thrust": "2"}),
            "params['plant.thrust']: expected a number",
        ),
        (
            lambda: ct.input_output_response(CRAFT.plant().to_control(), T, 0, params={"plant.thrust": "2"}),
            "params['plant.thrust']: expected a number, found '2'",
        ),
        (lambda: CRAFT.plant().to_numpy().derivatives(0.0, "here"), "x: expected numbers, found 'here'"),
    ],
)
def test_one_line_says_what_was_expected_and_found(call, said):
    with pytest.raises(InputError) as error:
        call()
    assert said in str(error.value)


def test_a_sequence_is_an_array_where_a_symbol_may_stand_too():
    assert rudder_of_force_angle([0.0, 0.1]).tolist() == [rudder_of_force_angle(a) for a in (0.0, 0.1)]
