"""Effects on any Block: a servo with friction of one's own, found from closed-loop data."""

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects import Coefficient, Effect, Shape, effect
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log


class ServoCogging(Effect):
    """Torque of a motor's magnets, in waves of the angle."""

    name, source = "servo_cogging", "a test"
    value = Coefficient("rad/s^2")

    def terms(self, c, s):
        import sympy as sp

        return {"rate": c.value * sp.sin(6 * s.angle)}


class ServoCoulomb(Effect):
    """Dry friction of a bearing."""

    name, source = "servo_coulomb", "a test"
    value = Coefficient("rad/s^2", lower=0.0)
    width = Shape("rad/s", lower=1e-9, default=0.01)

    def terms(self, c, s):
        return {"rate": -c.value * sgn(s.rate, c.width)}


OWN = {cls.name: Effect.known.pop(cls.name) for cls in (ServoCogging, ServoCoulomb)}


@pytest.fixture(autouse=True, scope="module")
def known_here_only():
    Effect.known.update(OWN)
    yield
    for name in OWN:
        Effect.known.pop(name)


def servo():
    angle, rate = Signal("angle", "rad"), Signal("rate", "rad/s")
    current = Signal("current", "A")
    gain = Signal("gain", "rad/s^2/A", start=20.0, lower=0.0)
    damping = Signal("damping", "1/s", start=2.0, lower=0.0)
    return Block(
        "servo",
        [angle, rate],
        [current],
        [angle],
        [gain, damping],
        {"angle": rate.symbol, "rate": gain.symbol * current.symbol - damping.symbol * rate.symbol},
    )


CATALOGUE = ["servo_coulomb", "servo_cogging", "input_delay"]


def closed_loop_log(model, seed, seconds=20.0, dt=0.01):
    """Position measured, current commanded by a controller that sees the noisy position."""
    rng = np.random.default_rng(seed)
    block = model.plant()
    f = block.to_numpy().array_derivatives
    p = block.parameter_values()
    t = np.arange(0.0, seconds, dt)
    goal = np.repeat(rng.uniform(-2, 2, t.size // 100 + 1), 100)[: t.size]
    x, seen, currents, last = np.zeros(2), [], [], 0.0
    for k in range(t.size):
        y = x[0] + 1e-3 * rng.normal()
        rate = (y - last) / dt if k else 0.0
        last = y
        u = float(np.clip(3.0 * (goal[k] - y) - 0.02 * rate, -3, 3))
        seen.append(y)
        currents.append(u)
        for _ in range(20):
            k1 = np.array(f(0.0, x, [u], p))
            x = x + dt / 20 * np.array(f(0.0, x + dt / 40 * k1, [u], p))
    return Log(f"servo {seed}", t, {"angle": np.array(seen), "current": np.array(currents)})


@pytest.mark.slow
@pytest.mark.parametrize("name", ["servo_coulomb", "servo_cogging"])
def test_a_users_effect_is_found_on_a_users_machine_in_closed_loop(name):
    hidden = effect(name, 4.0)
    truth = BlockModel(servo(), CATALOGUE).with_effects([hidden])
    off = BlockModel(servo().with_values({"gain": 20.4, "damping": 1.95}), CATALOGUE)
    found = diagnose(off, [closed_loop_log(truth, s) for s in (1, 2)], closed_loop_log(truth, 3))
    assert found.verdict == "effect"
    assert [e.effect for e in found.effects][:1] == [name]
    assert found.effects[0].value == pytest.approx(4.0, rel=0.02)
    assert found.after.nrmse["angle"] < 0.5 * found.before.nrmse["angle"]
    assert found.amended.coefficients()["gain"] == pytest.approx(20.0, rel=0.01)


def test_terms_are_added_where_they_say():
    model = BlockModel(servo(), CATALOGUE, [effect("servo_coulomb", 4.0)])
    dx = model.plant().to_numpy().derivatives(0.0, [0.3, 1.0], [0.5])
    np.testing.assert_allclose(dx, [1.0, 10.0 - 2.0 - 4.0])
    assert model.coefficients() == {
        "gain": 20.0,
        "damping": 2.0,
        "servo_coulomb": 4.0,
        "servo_coulomb_width": 0.01,
    }
    assert model.with_coefficients({"gain": 5.0, "servo_coulomb": 1.0}).plant().to_numpy().derivatives(
        0.0, [0.3, 1.0], [0.5]
    )[1] == pytest.approx(2.5 - 2.0 - 1.0)


def test_wrong_names_are_answered():
    with pytest.raises(InputError, match="unknown effect 'servo_colomb'; did you mean 'servo_coulomb'"):
        BlockModel(servo(), ["servo_colomb"])
    with pytest.raises(InputError, match="no coefficient 'gian'; did you mean 'gain'"):
        BlockModel(servo()).with_coefficients({"gian": 1.0})
    with pytest.raises(InputError, match="has no state 'u'"):
        BlockModel(servo(), [], [effect("body_surge_force", 0.1)]).plant()
