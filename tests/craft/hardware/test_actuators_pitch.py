"""A variable-pitch propeller: blade-element theory, both ways alike, no brake, and a part of the loop."""

import numpy as np
import pytest
from scipy.optimize import brentq

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.blocks.interconnect import interconnect
from hovercontrol.blocks.simulation.sampled import Ticking
from hovercontrol.control.autopilot import Imperfections, autopilot, beside_ideal
from hovercontrol.control.controllers.k06 import force_to_command, reverse, setpoints
from hovercontrol.craft.hardware.actuators import (
    VariablePitch,
    blade_element,
    fan_tables,
    pitch_lookup,
    pitch_servo,
    pitch_thrust,
    variable_pitch_propeller,
)
from hovercontrol.craft.models.vehicles import hoverdemon
from hovercontrol.fmi import load

RADIUS, SPEED, CHORD, AIR = 0.0889, 1256.6, 0.015, 1.2


def thrust_of(propeller, pitch, rudder=0.0):
    return pitch_thrust(propeller).to_numpy().outputs(0.0, (), [pitch, rudder])[0]


def test_the_thrust_is_that_of_blade_elements_in_their_own_inflow():
    """Momentum and blade-element thrust are solved for the inflow numerically, as neither Block does."""
    pitch, share = blade_element(1.944, RADIUS, SPEED, CHORD)
    made = VariablePitch(thrust=1.944, pitch=pitch, inflow=share)
    area, tip, solidity = np.pi * RADIUS**2, SPEED * RADIUS, 2 * CHORD / (np.pi * RADIUS)

    def elements(inflow, angle):
        return solidity * 5.7 / 2 * (angle / 3 - inflow / 2)

    for angle in np.linspace(0.01, 1.0, 15) * pitch:
        inflow = brentq(lambda v, a: 2 * v**2 - elements(v, a), 0.0, 1.0, args=(angle,))  # C_T = 2 lambda^2
        wanted = elements(inflow, angle) * AIR * area * tip**2
        assert thrust_of(made, angle) == pytest.approx(wanted, rel=1e-9)
        assert thrust_of(made, -angle) == pytest.approx(-wanted, rel=1e-9)


def test_the_lookup_is_the_force_backwards_and_ends_at_full_pitch():
    made = VariablePitch(rudder_loss=0.5)
    lookup, force = pitch_lookup(made).to_numpy(), pitch_thrust(made).to_numpy()
    for rudder in np.radians([-30.0, 0.0, 20.0]):
        most = made.thrust * np.cos(rudder) * (1 - 0.5 * (np.degrees(rudder) / 35) ** 2)
        for wanted in (*np.linspace(-most, most, 21), 0.01 * most, 3.0, -3.0):
            pitch, outside = lookup.outputs(0.0, (), [wanted, rudder])
            got = force.outputs(0.0, (), [pitch, rudder])[0]
            assert got == pytest.approx(np.clip(wanted, -most, most), abs=1e-9)
            assert bool(outside) == (abs(wanted) > most * (1 + 1e-8))


def test_at_full_pitch_it_pushes_as_the_fan_does_ahead_and_more_astern():
    forces = fan_tables()[1]
    for k, rudder in enumerate(np.radians(forces.rudder)):
        assert thrust_of(None, 0.135, rudder) == pytest.approx(forces.values[k, -1], rel=1e-6)
        assert -thrust_of(None, -0.135, rudder) > 2 * -forces.values[k, 0]


def test_the_servo_nears_its_command_as_a_lag_of_the_first_order():
    servo = Ticking(pitch_servo(lag=0.05, period=0.001))
    told = [servo.tick(0.001 * k, {"pitch_command": -0.1})["blade_pitch"] for k in range(200)]
    np.testing.assert_allclose(told, -0.1 * (1 - np.exp(-0.001 * np.arange(1, 201) / 0.05)), atol=1e-12)
    assert Ticking(pitch_servo(lag=0.0)).tick(0.0, {"pitch_command": 0.1})["blade_pitch"] == 0.1


def test_as_fmu_it_does_what_the_block_does(tmp_path):
    try:
        find_compiler()
    except NoCompilerError as error:
        pytest.skip(f"{error}: no FMU can be built")
    block = variable_pitch_propeller()
    rng = np.random.default_rng(2)
    here = block.start()
    with load(block.to_fmu(tmp_path / "pitch.fmu", step=0.02)) as fmu, fmu.start() as there:
        for _ in range(50):
            wanted = [rng.normal(), 0.3 * rng.normal()]
            np.testing.assert_allclose(there.step(wanted, 0.02), here.step(wanted, 0.02), atol=1e-9)


def astern(imperfections, propeller):
    law = reverse(k1=1.5, k2=1.0, alpha=1.44)
    told, start = {"surge_ref": -0.76}, {"v": -0.1, "r": 0.1}
    real = autopilot(law, references=told, start=start, imperfections=imperfections, propeller=propeller)
    plant = hoverdemon().plant().with_values(start)
    direct = force_to_command(dead_zone=0.0, reversing=True)
    ideal = interconnect([plant, setpoints([law], told), law, direct], "loop")
    return beside_ideal(real, ideal).compile().simulate(np.arange(0, 4.0, 0.02), method="rk4", step=0.02)


@pytest.mark.slow
def test_in_the_loop_with_everything_off_it_is_the_ideal_one_and_it_never_brakes():
    run = astern(Imperfections.only(), VariablePitch())
    found = dict(zip(run.output_labels, run.outputs, strict=True))
    assert np.abs(found["u"] - found["ideal_u"]).max() < 5e-3  # commands one tick of 1 ms late
    assert "drive_mode" not in found and found["blade_pitch"].min() < 0 < found["blade_pitch"].max() + 1e-9
    lagging = astern(Imperfections.only("brake"), VariablePitch(lag=0.2))
    late = dict(zip(lagging.output_labels, lagging.outputs, strict=True))
    assert np.abs(late["u"] - late["ideal_u"]).max() > 0.02


@pytest.mark.parametrize(
    ("wrong", "line"),
    [
        (lambda: VariablePitch(thrust=0.0), "variable pitch: thrust must be positive"),
        (lambda: VariablePitch(inflow=1.0), "inflow must be at least 0 and less than 1"),
        (lambda: VariablePitch(lag=-1.0), "lag must not be negative"),
        (lambda: pitch_servo(period=0.0), "period must be positive"),
        (lambda: blade_element(1.0, 0.0, 1.0, 1.0), "radius must be positive"),
        (
            lambda: autopilot(reverse(k1=1, k2=1, alpha=1), propeller=VariablePitch(), tables=fan_tables()),
            "tables belong to a fan",
        ),
    ],
)
def test_what_cannot_be_is_one_line(wrong, line):
    with pytest.raises(InputError, match=line):
        wrong()
