"""Long functions in C are loops, and compute what NumPy computes."""

import re
import shutil
import subprocess

import numpy as np
import pytest
import sympy as sp

from hovercontrol import Block, Signal
from hovercontrol.blocks.backends.c import c_source, function_source
from hovercontrol.blocks.backends.c_nests import nests
from hovercontrol.blocks.backends.runtime import runtime_folder
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.functions import numpy_functions
from tests.blocks.backends.test_board import STRICT

WINDOWS, CANDIDATES, ROWS = 4, 9, 5


def symbol(name):
    return sp.Symbol(name, real=True)


def bank():
    """Return a Block of repeated equations, of which some members differ: other terms, numbers and chains."""
    x = [[Signal(f"x[{w},{j}]", start=0.1 * w + 0.01 * j) for j in range(CANDIDATES)] for w in range(WINDOWS)]
    floor = [Signal(f"floor_{word}", start=2.0 + k) for k, word in enumerate("abcdefghi")]
    push, gate = Signal("push"), Signal("gate", start=0.7)
    definitions, following = {}, {}
    for k in range(ROWS):
        definitions[f"C[{k}]"] = sp.cos(push.symbol + k)
    for w in range(WINDOWS):
        for j in range(CANDIDATES):
            for k in range(ROWS):
                more = 3 * gate.symbol if j == 4 else 0  # one candidate has a term of its own
                definitions[f"eta[{w},{j},{k}]"] = x[w][j].symbol * symbol(f"C[{k}]") - push.symbol + more
            eta = [symbol(f"eta[{w},{j},{k}]") for k in range(ROWS)]
            definitions[f"b[{w},{j}]"] = sp.Max(0, sum(e**2 for e in eta) / floor[j].symbol - j)
            older = symbol(f"chain[{w},{j - 1}]") if j else push.symbol  # each needs the one before
            definitions[f"chain[{w},{j}]"] = older / 2 + symbol(f"b[{w},{j}]")
    for w in range(WINDOWS):
        for j in range(CANDIDATES):
            below = x[w - 1][j].symbol if w else symbol(f"eta[0,{j},0]")
            best = sp.Piecewise(
                (below, gate.symbol > sp.S.Half),
                (symbol(f"b[{w},{j}]"), push.symbol > w),
                (sp.Integer(j), True),
            )
            following[f"x[{w},{j}]"] = best
    total = sum(symbol(f"chain[{w},{j}]") for w in range(WINDOWS) for j in range(CANDIDATES))
    return Block(
        "bank", [s for row in x for s in row], [push], [Signal("total")], [gate, *floor], following,
        {"total": total}, definitions, period=0.1,
    )  # fmt: skip


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler (cc) on this machine")
def test_loops_compute_what_numpy_computes(tmp_path):
    block = bank()
    wanted = [
        *block.derivatives.values(),
        *block.output_expressions.values(),
        *map(symbol, block.definitions),
    ]
    n, rng = len(wanted), np.random.default_rng(1)
    source = function_source(block, "values", wanted)
    assert source.count("for (int") >= 5
    assert len(re.findall(r"\n    (?:const double )?\w+(?:\[\d+\])? = ", source)) < n / 4
    x, u, p = rng.normal(size=len(block.states)), np.array([0.3]), np.array(block.parameter_values())
    lists = [", ".join(map(repr, a.tolist())) for a in (x, u, p)]
    (tmp_path / "main.c").write_text(
        f"#include <math.h>\n#include <stdio.h>\n#include \"hc_math.h\"\n\n{source}\n\nint main(void)\n{{\n"
        f"    const double x[] = {{{lists[0]}}}, u[] = {{{lists[1]}}}, p[] = {{{lists[2]}}};\n"
        f"    double y[{n}];\n    values(0.0, x, u, p, 0, y);\n    for (int i = 0; i < {n}; i++)\n"
        "        printf(\"%.17g\\n\", y[i]);\n}\n"
    )  # fmt: skip
    flags = [*STRICT, "-O3", "-ffp-contract=off", f"-I{runtime_folder()}"]
    subprocess.run(["cc", *flags, tmp_path / "main.c", "-o", tmp_path / "main", "-lm"], check=True)
    said = subprocess.run([tmp_path / "main"], capture_output=True, text=True, check=True).stdout
    shown = [Signal(f"y{k}") for k in range(n)]
    outputs = Expressions((s.name, e) for s, e in zip(shown, wanted, strict=True))
    numpy = numpy_functions(block.unchecked(outputs=tuple(shown), output_expressions=outputs))
    assert np.array(said.split(), dtype=float) == pytest.approx(
        numpy.outputs(0.0, x, u), rel=1e-14, abs=1e-15
    )


def test_every_place_of_a_table_is_visited_once():
    rng = np.random.default_rng(2)
    for _ in range(50):
        places = rng.integers(0, 3, size=(rng.integers(1, 40), 2))
        rows = []
        for nest in nests(places):
            for at in np.ndindex(*nest.lengths):
                rows.append(nest.first + sum(k * s for k, s in zip(at, nest.strides, strict=True)))
        assert np.array_equal(rows, places)


def test_short_functions_stay_straight():
    v, k = Signal("v[0]", "m/s"), Signal("k", "1/s", start=2.0)
    assert "for (int" not in c_source(Block("decay", [v], [], [v], [k], {"v[0]": -k.symbol * v.symbol}))
