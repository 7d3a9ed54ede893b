"""A wrong convention of one column contradicts the others by kinematics, and is named; right ones pass."""

import numpy as np
import pytest

from hovercontrol.logs import Log
from hovercontrol.logs.cross_checks import convention_faults


def drive(rng: np.random.Generator, noise: float = 0.0) -> dict[str, np.ndarray]:
    """Return a run with sway, in z up, by integration of z' = (u + i v) e^{i psi} over fine steps."""
    t = np.arange(0.0, 40.0, 0.02)
    phases = rng.uniform(0.0, 6.28, 3)
    r = 0.4 + 0.5 * np.sin(0.5 * t + phases[0])
    u, v = 0.8 + 0.3 * np.sin(0.7 * t + phases[1]), 0.15 * np.sin(0.9 * t + phases[2])
    psi = np.cumsum(r) * 0.02 + rng.uniform(-3.0, 3.0)
    z = np.cumsum((u + 1j * v) * np.exp(1j * psi)) * 0.02
    run = {"x": z.real, "y": z.imag, "psi": psi, "u": u, "v": v, "r": r}
    return {"time": t} | {k: s + noise * rng.normal(size=t.size) for k, s in run.items()}


FAULTS = {
    "right": (lambda s: {}, None),
    "r": (lambda s: {"r": -s["r"]}, "column 'r' is minus the rate of psi"),
    "compass": (lambda s: {"psi": np.pi / 2 - s["psi"], "r": -s["r"]}, "compass heading"),
    "world": (lambda s: {
        "u": (s["u"] * np.cos(s["psi"]) - s["v"] * np.sin(s["psi"])),
        "v": (s["u"] * np.sin(s["psi"]) + s["v"] * np.cos(s["psi"]))}, "velocities along x and y"),
    "sign": (lambda s: {"psi": -s["psi"], "r": -s["r"]}, "psi turns from y to x"),
    "90": (lambda s: {"psi": s["psi"] + np.pi / 2}, "psi is 90 deg too large"),
    "180": (lambda s: {"psi": s["psi"] + np.pi}, "180 deg off"),
    "knots": (lambda s: {"u": s["u"] * 3.6 / 1.852, "v": s["v"] * 3.6 / 1.852}, "are they in knot"),
    "km/h": (lambda s: {"u": s["u"] * 3.6, "v": s["v"] * 3.6}, "are they in km/h"),
}  # fmt: skip


def log_of(signals: dict[str, np.ndarray], *left: str) -> Log:
    return Log("a", signals["time"], {k: v for k, v in signals.items() if k not in ("time", *left)})


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("seed", [1, 2])
def test_velocities_tell_a_wrong_convention(name: str, seed: int) -> None:
    signals = drive(np.random.default_rng(seed), noise=2e-3)
    change, said = FAULTS[name]
    found = convention_faults(log_of(signals | change(signals)))
    assert len(found) == (said is not None) and all(said in line for line in found)


@pytest.mark.parametrize(("name", "said"), [("right", None), ("compass", "compass heading"),
                                            ("sign", "psi turns against the course"),
                                            ("90", "9 deg to the right"),
                                            ("180", "deg to the")])  # fmt: skip
def test_the_course_tells_a_wrong_heading(name: str, said: str | None) -> None:
    signals = drive(np.random.default_rng(3), noise=2e-3)
    found = convention_faults(log_of(signals | FAULTS[name][0](signals), "u", "v", "r"))
    assert len(found) == (said is not None) and all(str(said) in line for line in found)


def test_a_craft_that_does_not_keep_its_bow_to_its_course_or_stands_is_not_judged() -> None:
    rng = np.random.default_rng(4)
    signals = drive(rng)
    free = signals | {"psi": np.cumsum(rng.normal(size=2000)) * 0.1}  # turns as it likes
    assert convention_faults(log_of(free, "u", "v", "r")) == []
    still = signals | {k: 1e-3 * rng.normal(size=2000) for k in ("x", "y", "psi", "u", "v", "r")}
    assert convention_faults(log_of(still)) == []
