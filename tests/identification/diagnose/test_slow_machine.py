"""A machine with time constants of a minute and a row a second is predicted as much farther ahead."""

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log

psi, r, delta = hc.Signal("psi", "rad"), hc.Signal("r", "rad/s"), hc.Signal("delta", "rad")
helm = hc.Signal("helm", "rad")
damping = hc.Signal("damping", "1/s", start=0.05, lower=0.0)
power = hc.Signal("power", "1/s^2", start=0.01)
servo = hc.Signal("servo", "1/s", start=0.5, lower=0.0)

#: A ship by Nomoto's equation, its rudder behind a slow servo; only a compass is there.
SHIP = hc.Block(
    "ship",
    states=[psi, r, delta],
    inputs=[helm],
    outputs=[psi],
    parameters=[damping, power, servo],
    derivatives={
        "psi": r.symbol,
        "r": -damping.symbol * r.symbol + power.symbol * delta.symbol,
        "delta": servo.symbol * (helm.symbol - delta.symbol),
    },
)


class CubicDamping(hc.Effect):
    """Damping of fast turns."""

    name = "cubic_damping"
    source = "Norrbin 1963"
    value = hc.Coefficient("s/rad^2", lower=0.0)

    def terms(self, c, s):
        return {"r": -c.value * s.r**3}


class TurningMoment(hc.Effect):
    """A moment that is always there."""

    name = "turning_moment"
    source = "a wind from abeam"
    value = hc.Coefficient("rad/s^2")

    def terms(self, c, s):
        return {"r": c.value}


MODEL = BlockModel(SHIP, catalogue=["cubic_damping", "turning_moment", "input_delay"])


def log(truth, seed, step):
    """Fifteen minutes, the helm put over every 20 s; the compass is good to 0.1 degrees."""
    rng, time = np.random.default_rng(seed), np.arange(0, 900, step)
    told = np.repeat(rng.uniform(-0.5, 0.5, 45), round(20 / step))
    run = truth.plant().compile().simulate(time, [told])
    heading = np.atleast_2d(run.outputs)[list(run.output_labels).index("psi")]
    return Log(f"run {seed}", time, {"psi": heading + 2e-3 * rng.normal(size=time.size), "helm": told})


@pytest.mark.slow("1.0", "hidden0", "hidden1")
@pytest.mark.parametrize("step", [1.0, 0.25])
@pytest.mark.parametrize("hidden", [{"cubic_damping": 20.0}, {"turning_moment": 3e-4}, {}])
def test_what_a_ship_lacks_is_found(hidden, step):
    truth = MODEL.with_effects([hc.effect(name, value) for name, value in hidden.items()])
    truth = truth.with_coefficients({"damping": 0.049, "power": 0.0102})
    found = diagnose(MODEL, [log(truth, 1, step), log(truth, 2, step)], log(truth, 3, step))
    assert found.verdict == ("effect" if hidden else "none")
    assert {e.effect: e.value for e in found.effects} == pytest.approx(hidden, rel=0.03)
    assert found.after.horizon > 1.5 and found.after.rms["psi"] < 0.01
