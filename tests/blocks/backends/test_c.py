"""The generated C is strict C99 and computes what NumPy computes."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest
import sympy as sp

from hovercontrol import Block, Signal, interconnect, vehicle, waypoints
from hovercontrol.blocks.backends.c import c_source
from hovercontrol.blocks.backends.runtime import runtime_folder
from hovercontrol.blocks.friction import dry_frictions, with_modes
from hovercontrol.documents.scenarios import load_scenario
from hovercontrol.documents.scenarios.runner import loop_parts

CC = shutil.which("cc")
needs_cc = pytest.mark.skipif(CC is None, reason="no C compiler (cc) on this machine")
HEADERS = runtime_folder()
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wshadow", "-Wconversion", "-Werror", "-pedantic"]

PARTS = loop_parts(load_scenario("table1"))
BLOCKS = {
    **PARTS,
    "loop": interconnect(list(PARTS.values()), "loop"),
    "four_fan": vehicle("four_fan").plant(),
    "waypoints": waypoints([[0, 0], [1, 2], [3, 1]], [0.0, 1.0, 2.5]),
}


class Model(ctypes.Structure):
    """hc_model_type of hc_model.h."""

    _fields_ = (
        [(n, ctypes.c_int) for n in ("states", "inputs", "parameters", "outputs", "friction")]
        + [(n, ctypes.c_void_p) for n in ("friction_state", "f_derivatives", "f_outputs", "f_friction")]
        + [("n_partials", ctypes.c_int)]
        + [(n, ctypes.c_void_p) for n in ("partial_row", "partial_column", "f_partials", "next_switch")]
    )


class Compiled:
    def __init__(self, block, folder, friction):
        source = folder / f"{block.name}.c"
        source.write_text(c_source(block, friction=friction))
        library = folder / f"{block.name}.so"
        subprocess.run(
            [CC, *STRICT, "-O1", "-fPIC", "-shared", f"-I{HEADERS}", source, "-o", library, "-lm"], check=True
        )
        self.library = ctypes.CDLL(str(library))
        self.model = Model.in_dll(self.library, "hc_model")

    def call(self, name, sizes, t, x, u, p, modes):
        arrays = [np.ascontiguousarray(a, dtype=float) for a in (x, u, p)]
        modes = np.ascontiguousarray(modes, dtype=np.intc)
        results = [np.full(n, np.nan) for n in sizes]
        pointers = [a.ctypes.data_as(ctypes.c_void_p) for a in (*arrays, modes, *results)]
        types = [ctypes.c_double, *[ctypes.c_void_p] * len(pointers)]
        ctypes.CFUNCTYPE(None, *types)(getattr(self.model, name))(t, *pointers)
        return results

    def partials(self, shape, t, x, u, p):
        n = self.model.n_partials
        rows, columns = (
            np.ctypeslib.as_array(ctypes.cast(place, ctypes.POINTER(ctypes.c_ushort)), (n,))
            for place in (self.model.partial_row, self.model.partial_column)
        )
        full = np.zeros(shape)
        (full[rows, columns],) = self.call("f_partials", [n], t, x, u, p, [])
        return full


def points(block, rng, n=20):
    p = np.array(block.parameter_values())
    for _ in range(n):
        yield rng.uniform(0, 3), rng.normal(0, 1, len(block.states)), rng.normal(0, 1, len(block.inputs)), p


@pytest.mark.slow("loop")
@needs_cc
@pytest.mark.parametrize("name", BLOCKS)
def test_smooth_c_is_numpy(name, tmp_path):
    block = BLOCKS[name]
    compiled = Compiled(block, tmp_path, "smooth")
    functions = block.to_numpy()
    assert compiled.model.friction == 0
    n = len(block.states)
    for t, x, u, p in points(block, np.random.default_rng(1)):
        (dx,) = compiled.call("f_derivatives", [n], t, x, u, p, [])
        np.testing.assert_allclose(dx, functions.derivatives(t, x, u), rtol=1e-11, atol=1e-11)
        (y,) = compiled.call("f_outputs", [len(block.outputs)], t, x, u, p, [])
        np.testing.assert_allclose(y, functions.outputs(t, x, u), rtol=1e-11, atol=1e-12)
        kinds = ("derivatives", "outputs"), ("states", "inputs", "parameters")
        exact = np.block(
            [[functions.jacobian(t, x, u, rows=r, columns=c) for c in kinds[1]] for r in kinds[0]]
        )
        np.testing.assert_allclose(compiled.partials(exact.shape, t, x, u, p), exact, rtol=1e-9, atol=1e-9)


@pytest.mark.slow("loop")
@needs_cc
@pytest.mark.parametrize("name", ["plant", "loop"])
def test_with_modes_slipping_is_a_plus_b_s_and_sticking_stands_still(name, tmp_path):
    block = BLOCKS[name]
    compiled = Compiled(block, tmp_path, "events")
    frictions = dry_frictions(block)
    assert compiled.model.friction == len(frictions) == 3
    states = [s.name for s in block.states]
    free = Block(  # the modes as inputs, so that NumPy can evaluate them
        block.name,
        block.states,
        (*block.inputs, *(Signal(f.symbol.name) for f in frictions)),
        block.outputs,
        block.parameters,
        with_modes(block, frictions).derivatives,
        block.output_expressions,
        block.definitions,
        block.definition_signals,
    )
    for modes in ((1, -1, 1), (-1, 0, 1), (0, 0, 0)):
        for t, x, u, p in points(block, np.random.default_rng(2), 5):
            (dx,) = compiled.call("f_derivatives", [len(states)], t, x, u, p, modes)
            expected = free.to_numpy().derivatives(t, x, [*u, *modes])
            a, b = compiled.call("f_friction", [3, 3], t, x, u, p, modes)
            for k, f in enumerate(frictions):
                i = states.index(f.state)
                slip = a[k] + b[k] * modes[k]
                assert dx[i] == (pytest.approx(slip, rel=1e-12, abs=1e-12) if modes[k] else 0.0)
                expected[i] = dx[i]
            np.testing.assert_allclose(dx, expected, rtol=1e-11, atol=1e-11)


@needs_cc
def test_functions_with_jumps_are_numpys(tmp_path):
    """Python's sign of a remainder, and one half at a step."""
    p, q = Signal("p"), Signal("q", lower=0.1, start=1.0)
    functions = {
        "mod": sp.Mod(p.symbol, q.symbol),
        "step": sp.Heaviside(p.symbol),
        "sign": sp.sign(p.symbol),
        "floor": sp.floor(p.symbol),
        "top": sp.Max(p.symbol, q.symbol, 0.3),
        "piece": sp.Piecewise((p.symbol, p.symbol > 0), (q.symbol, True)),
    }
    block = Block("odd", (), (p, q), tuple(Signal(n) for n in functions), output_expressions=functions)
    compiled = Compiled(block, tmp_path, "events")
    for value in (-2.3, -1.0, 0.0, 0.4, 1.0, 3.7):
        (y,) = compiled.call("f_outputs", [len(functions)], 0.0, [], [value, 0.7], [], [])
        np.testing.assert_allclose(y, block.to_numpy().outputs(0.0, [], [value, 0.7]), rtol=1e-14, atol=1e-15)


@needs_cc
def test_names_that_c_would_trip_over_are_kept_apart(tmp_path):
    names = ["x", "int", "t_2", "mode", "y0", "a", "P[0,1]", "P_0_1", "c0", "c1"]
    signals = tuple(Signal(n) for n in names)
    total = sum(s.symbol**k for k, s in enumerate(signals, 1))
    block = Block(
        "odd",
        (),
        signals,
        (Signal("z"), Signal("q")),
        (),
        output_expressions={"z": total**3 + total, "q": total**2 - signals[0].symbol},
    )
    compiled = Compiled(block, tmp_path, "events")
    u = np.linspace(0.1, 1.0, len(names))
    (y,) = compiled.call("f_outputs", [2], 0.0, [], u, [], [])
    np.testing.assert_allclose(y, block.to_numpy().outputs(0.0, [], u), rtol=1e-12)
