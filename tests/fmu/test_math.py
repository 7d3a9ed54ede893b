"""sin, cos and tanh of hc_math.h against mpmath: errors in units in the last place, and special values."""

from __future__ import annotations

import ctypes

import mpmath
import numpy as np
import pytest

from .support import MODELS, compile_c

NAMES = ("sin", "cos", "tanh")
#: Largest errors that hc_math.h states, in units in the last place.
ULP = {"sin": 1.0, "cos": 1.0, "tanh": 2.0}


@pytest.fixture(scope="module")
def values(compiler, tmp_path_factory):
    path = tmp_path_factory.mktemp("functions") / "functions.so"
    flags = ["-O3", "-shared", "-fPIC", "-ffp-contract=off", "-Wshadow", "-Wconversion"]
    compile_c(compiler, [MODELS / "functions.c"], path, flags)
    library = ctypes.CDLL(str(path))

    def evaluate(name, x):
        x = np.array(x, dtype=float)
        y = np.empty_like(x)
        pointers = (ctypes.c_void_p(a.ctypes.data) for a in (x, y))
        library.values(NAMES.index(name), ctypes.c_long(x.size), *pointers)
        return y

    return evaluate


def points(name, rng):
    """Points of all sizes, and those where the reduction loses most: next to multiples of pi/4 or ln(2)/4."""
    small = rng.normal(0, 1, 400) * 10.0 ** rng.uniform(-12, 1, 400)
    if name == "tanh":
        edges = np.arange(1, 60) * np.log(2) / 4
        return np.r_[small, rng.uniform(-0.4, 0.4, 600), rng.uniform(-20, 20, 200), edges, -edges]
    turns = np.r_[np.arange(1, 200), rng.integers(200, 2**21, 300)] * (np.pi / 4)
    near = np.r_[turns, np.nextafter(turns, 0.0), -turns]
    return np.r_[small, near, rng.uniform(-10, 10, 400), rng.uniform(-1.6e6, 1.6e6, 200)]


@pytest.mark.parametrize("name", NAMES)
def test_errors_are_as_small_as_stated(values, rng, name):
    x = points(name, rng)
    with mpmath.workprec(200):
        exact = [getattr(mpmath, name)(mpmath.mpf(v)) for v in x.tolist()]
        off = [
            float(abs(mpmath.mpf(y) - e) / mpmath.mpf(float(np.spacing(abs(float(e))))))
            for y, e in zip(values(name, x).tolist(), exact, strict=True)
        ]
    assert max(off) < ULP[name]


@pytest.mark.parametrize("name", NAMES)
def test_special_values_are_those_of_numpy(values, name):
    with np.errstate(invalid="ignore"):
        x = np.array([0.0, -0.0, np.nan, np.inf, -np.inf, 5e-324, -1e-310, 25.0, -25.0, 3e6, 1e22, 1e300])
        expected = getattr(np, name)(x)
    found = values(name, x)
    np.testing.assert_allclose(found, expected, rtol=4e-16, atol=0)
    np.testing.assert_array_equal(np.signbit(found[:2]), np.signbit(expected[:2]))
