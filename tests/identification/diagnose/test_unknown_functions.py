"""Unknown functions are found from logs, or refused with the reason."""

import json
from pathlib import Path

import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.craft.models.forms import FORMS
from hovercontrol.craft.models.functions import FormFunction, Unknown
from hovercontrol.identification.diagnose.unknown.forms import nearest_forms, whitened

V, F = hc.Signal("v", "m/s"), hc.Signal("F", "m/s^2")
K, C = hc.Signal("k", "1", start=1.0), hc.Signal("c", "1/s", start=0.5)
DRAG = hc.unknown("drag", of=["v"], unit="m/s^2")


def run(seconds: float = 12.0, noise: float = 1e-3) -> hc.Log:
    """A cart with the drag 2 v/(0.6 + v), integrated by Euler's method in small steps."""
    rng, n = np.random.default_rng(0), int(seconds * 10)
    push = np.repeat(rng.uniform(0.0, 1.6, n // 10), 10)
    v, seen = 0.3, []
    for force in push:
        seen.append(v)
        for _ in range(200):
            v += 0.0005 * (force - 2.0 * v / (0.6 + v))
    return hc.Log("run", np.arange(n) / 10, {"v": np.array(seen) + noise * rng.normal(size=n), "F": push})


def cart(slope: object, *parameters: hc.Signal) -> hc.Block:
    return hc.Block("cart", [V], [F], [V], list(parameters), {"v": slope})


@pytest.mark.slow
def test_identify_gives_it_as_a_table_with_errors() -> None:
    found = hc.identify(cart(F.symbol - DRAG), [run()])
    (drag,) = found.functions
    truth = 2.0 * drag.grid / (0.6 + drag.grid)
    assert np.abs(drag.values - truth).max() < 0.02
    assert np.all(np.abs(drag.values - truth) < 3.5 * drag.std)  # of ten normal errors: 1 in 200 fails
    assert "v [m/s]" in found.table() and len(drag.plot().axes) == 1
    at = float(drag.grid[3])
    assert found.block.to_numpy().derivatives(0.0, [at], [0.0])[0] == pytest.approx(-drag.values[3])


@pytest.mark.slow
def test_samples_at_which_it_is_largest_are_no_outliers() -> None:
    # drag of the relative wind, whose extremes follow its jumps: a constant does not reach them
    w, rng, n = hc.Signal("w", "m/s"), np.random.default_rng(3), 300
    drag = hc.unknown("drag", of=["relative"], unit="m/s^2")
    known = {"relative": V.symbol - w.symbol}
    block = hc.Block("cart", [V], [F, w], [V], [], {"v": F.symbol - drag}, definitions=known)
    push, wind = np.repeat(rng.uniform(-1.0, 1.0, 30), 10), np.repeat(rng.uniform(-1.0, 1.0, 20), 15)
    v, rows = 0.0, []
    for k in range(n):
        rows.append(v)
        for _ in range(100):
            v += 0.001 * (push[k] - 1.5 * (v - wind[k]) * abs(v - wind[k]))
    seen = np.array(rows) + 2e-3 * rng.normal(size=n)
    (found,) = hc.identify(
        block, [hc.Log("run", np.arange(n) / 10, {"v": seen, "F": push, "w": wind})]
    ).functions
    relative = np.array(rows) - wind
    assert found.grid[[0, -1]] == pytest.approx([relative.min(), relative.max()], abs=0.01)
    assert np.abs((found.values - 1.5 * found.grid * abs(found.grid)) / found.std).max() < 3.5


@pytest.mark.slow("product")
@pytest.mark.parametrize(
    ("slope", "parameter", "reason"),
    [
        pytest.param(F.symbol - K.symbol * DRAG, K, "do not tell it from k", id="product"),
        pytest.param(F.symbol - C.symbol * V.symbol - DRAG, C, "do not tell it from c", id="sum"),
    ],
)
def test_one_beside_a_free_coefficient_is_refused(slope: object, parameter: hc.Signal, reason: str) -> None:
    with pytest.raises(hc.InputError, match=reason):
        hc.identify(cart(slope, parameter), [run(6.0)])


def test_one_that_logs_do_not_excite_is_refused() -> None:
    rng, t = np.random.default_rng(0), np.arange(60) / 10
    still = hc.Log("still", t, {"v": 1.0 + 1e-3 * rng.normal(size=60), "F": np.ones(60)})
    with pytest.raises(hc.InputError, match=r"drag\(v\): (v stays between|nothing measured depends)"):
        hc.identify(cart(F.symbol - DRAG), [still])


@pytest.mark.parametrize("form", ["saturating", "inhibited", "power", "logistic", "hinge on a line", "hill"])
def test_the_nearest_form_to_exact_values_is_their_own(form: str) -> None:
    of, grid = Unknown("f", "1", "1", ()), np.linspace(0.2, 8.0, 12)
    numbers = (1.5, 2.3, 0.8)[: len(FormFunction(of, form, ()).keys)]
    values = FormFunction(of, form, numbers).values(grid)
    seen = whitened(grid, values, 1e-8 * np.eye(12), np.linspace(0.2, 8.0, 300))
    near = [f for f, _ in nearest_forms(of, seen)]
    own = next(f for f in near if f.form == form)
    assert np.allclose(own.numbers, numbers, rtol=1e-3)
    # a form with fewer numbers is not as near
    assert all(len(f.keys) >= len(own.keys) for f in near[: near.index(own)])
    assert form in FORMS


@pytest.mark.slow
def test_diagnose_names_the_form_and_saves_it(tmp_path: Path) -> None:
    found = hc.diagnose(cart(F.symbol - DRAG), [run(30.0)])
    best = found.functions[0].forms[0]
    assert (best.name, best.text) == ("saturating", "a v/(b + v)")
    for value, (estimate, std) in zip((2.0, 0.6), best.numbers.values(), strict=True):
        assert abs(estimate - value) < 3.0 * std
    assert sum(f.probability for f in found.functions[0].forms) == pytest.approx(1.0)
    found.save(tmp_path)
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["functions"][0]["forms"][0]["text"] == "a v/(b + v)"
    again = hc.load_parameters(cart(F.symbol - DRAG), tmp_path / "parameters.toml")
    assert again.coefficients()["drag_b"] == pytest.approx(best.numbers["b"][0], rel=0.02)


def test_a_form_that_is_a_line_over_the_logs_pays_for_its_number() -> None:
    # a v/(b + v) is a line at all large b: the mean likelihood over b relative to a line's, by quadrature
    grid, std = np.linspace(0.0, 1.0, 6), 0.02
    of, y = Unknown("f", "1", "1", ()), grid + 0.0
    seen = whitened(grid, y, std**2 * np.eye(6), np.linspace(0.0, 1.0, 200))
    own = {f.form: unused for f, unused in nearest_forms(of, seen)}
    angle = np.linspace(0.0, 0.5 * np.pi, 200_001)  # b = tan(angle): all of them, none twice
    shapes = grid / (np.tan(angle)[:, None] + grid + 1e-12)
    q = shapes / np.linalg.norm(shapes, axis=1)[:, None]
    area = np.r_[0.0, np.linalg.norm(np.diff(q, axis=0), axis=1)]
    misfit = (y @ y - (q @ y) ** 2) / std**2
    mean = np.sum(area * np.exp(-0.5 * misfit)) / area.sum()
    assert own["saturating"] - own["proportional"] == pytest.approx(np.log(mean), abs=0.1)
