"""Vectors and matrices of a Block are array variables in FMI 3 if asked for, scalars otherwise."""

import ctypes

import control
import fmpy
import numpy as np
import pytest
import scipy.linalg
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model, FMU3Slave

import hovercontrol as hc
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.fmi.exporter.description import Experiment, model_description
from hovercontrol.fmi.exporter.units import fmi_unit
from hovercontrol.fmi.exporter.variables import Interface
from hovercontrol.fmi.importer.archive import Header
from hovercontrol.fmi.importer.reading import read_interface

from .blocks import BLOCKS

try:
    find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)

A = np.array([[-0.5, 1.0], [-1.0, -0.2]])
X0 = np.array([[1.0, 0.0, 2.0], [0.0, -1.0, 0.5]])
U = np.array([0.3, -0.7])


def matrix_block():
    """X' = A X + u B', X of 2 x 3, B of ones; y is the sum of the first two columns, z = X[1,1] + u[2] T."""
    rows, columns = range(1, 3), range(1, 4)
    X = [
        [hc.Signal(f"X[{i},{j}]", "m" if j < 3 else "s", start=X0[i - 1, j - 1]) for j in columns]
        for i in rows
    ]
    u = [hc.Signal(f"u[{i}]", "m/s") for i in rows]
    a = [[hc.Signal(f"A[{i},{j}]", "1/s", start=A[i - 1, j - 1]) for j in rows] for i in rows]
    b = [hc.Signal(f"B[{j}]", "1" if j < 3 else "s/m", start=1.0) for j in columns]
    T = hc.Signal("T", "s", start=1.0)
    y = [hc.Signal(f"y[{i}]", "m", f"row {i}") for i in rows]
    rates = {
        X[i][j].name: sum(a[i][k].symbol * X[k][j].symbol for k in range(2)) + u[i].symbol * b[j].symbol
        for i in range(2)
        for j in range(3)
    }
    sums = {y[i].name: X[i][0].symbol + X[i][1].symbol for i in range(2)}
    flat = [s for row in X for s in row]
    return hc.Block(
        "matrix",
        flat,
        u,
        [*y, hc.Signal("z", "m")],
        [*(s for row in a for s in row), *b, T],
        derivatives=rates,
        output_expressions=sums | {"z": flat[0].symbol + u[1].symbol * T.symbol},
    )


def exact(t):
    """Constant u: X = e^(A t) X0 + A^-1 (e^(A t) - 1) u 1'."""
    e = scipy.linalg.expm(A * t)
    forced = np.linalg.solve(A, (e - np.eye(2)) @ U)
    return e @ X0 + np.outer(forced, np.ones(3))


@pytest.fixture(scope="module")
def fmu(tmp_path_factory):
    return matrix_block().to_fmu(tmp_path_factory.mktemp("arrays") / "matrix.fmu", rtol=1e-10, arrays=True)


def shapes(path):
    return {v.name: v.shape or () for v in fmpy.read_model_description(path, validate=True).modelVariables}


def test_arrays_have_dimensions_and_fmi_2_has_scalars(fmu, tmp_path):
    assert shapes(fmu) == {
        **{
            "time": (),
            "X": (2, 3),
            "der(X)": (2, 3),
            "u": (2,),
            "matrix.A": (2, 2),
            "matrix.B": (3,),
            "matrix.T": (),
            "y": (2,),
            "z": (),
        }
    }
    two = shapes(matrix_block().to_fmu(tmp_path / "two.fmu", version=2))
    assert len(two) == 1 + 6 + 6 + 2 + 8 + 2 + 1 and "X[1,2]" in two
    assert set(shapes(matrix_block().to_fmu(tmp_path / "flat.fmu"))) == set(two)


@pytest.mark.parametrize("kind", ["ModelExchange", "CoSimulation"])
def test_fmpy_validates_and_simulates_arrays(fmu, kind):
    result = fmpy.simulate_fmu(
        str(fmu),
        validate=True,
        fmi_type=kind,
        start_values={"u": U.tolist()},
        output=["X", "y", "z"],
        stop_time=2.0,
        output_interval=0.5,
        relative_tolerance=1e-9,
    )
    assert result["X"].shape == (5, 2, 3)
    for t, x, y, z in zip(result["time"], result["X"], result["y"], result["z"], strict=True):
        np.testing.assert_allclose(x, exact(t), atol=1e-6)
        np.testing.assert_allclose(y, exact(t)[:, :2].sum(axis=1), atol=1e-6)
        assert z == pytest.approx(exact(t)[0, 0] + U[1], abs=1e-6)


def test_the_loop_of_table_one_has_a_vector_of_its_covariance(tmp_path):
    """237 scalars and time; 66 entries of the covariance's upper triangle, and their derivatives."""
    interface, file = Interface(BLOCKS["loop"], arrays=True), tmp_path / "modelDescription.xml"
    counts = {}
    for version in (2, 3):
        file.write_bytes(
            model_description(interface, version, "{0}", Experiment(1.0, 0.1, 1e-6), "a loop", ["x.c"])
        )
        counts[version] = len(fmpy.read_model_description(str(file), validate=True).modelVariables)
    assert counts == {2: 238, 3: 238 - 2 * (66 + 11) - 3 - 11 + 6}
    read = read_interface(file, Header("fmiModelDescription", {"fmiVersion": "3.0"}), "x", "ModelExchange")
    assert [label for v in read.states for label in v.labels] == [s.name for s in interface.block.states]
    units = {label: unit for v in read.states for label, unit in zip(v.labels, v.units, strict=True)}
    assert (
        units["estimator.P[3,4]"]
        == fmi_unit(next(s.unit for s in interface.block.states if s.name == "estimator.P[3,4]")).name
    )


def opened(path, kind=FMU3Slave):
    description = fmpy.read_model_description(path)
    instance = kind(
        guid=description.guid,
        unzipDirectory=fmpy.extract(path),
        modelIdentifier="matrix",
        instanceName="one",
    )
    instance.instantiate()
    return instance, {v.name: v.valueReference for v in description.modelVariables}


def test_arrays_and_scalars_are_got_and_set_together(fmu):
    instance, vr = opened(fmu)
    new = np.arange(6.0).reshape(2, 3)
    instance.setFloat64([vr["u"], vr["X"]], [*U, *new.ravel()])
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    wanted = [vr["time"], vr["y"], vr["X"], vr["z"], vr["u"]]
    found = instance.getFloat64(wanted, 1 + 2 + 6 + 1 + 2)
    np.testing.assert_allclose(found, [0.0, *new[:, :2].sum(axis=1), *new.ravel(), new[0, 0] + U[1], *U])
    instance.doStep(0.0, 0.1)
    rates, orders = (ctypes.c_double * 2)(), (ctypes.c_int32 * 1)(1)  # FMPy's own call takes scalars only
    references = (ctypes.c_uint32 * 1)(vr["y"])
    assert instance.fmi3GetOutputDerivatives(instance.component, references, 1, orders, rates, 2) == 0
    x = np.reshape(instance.getFloat64([vr["X"]], 6), (2, 3))
    np.testing.assert_allclose(rates, (A @ x + U[:, None])[:, :2].sum(axis=1), rtol=1e-7)
    instance.terminate()
    instance.freeInstance()


@pytest.mark.parametrize(
    ("name", "more", "count", "words"),
    [("X", 0, 5, "6 elements, but there are 5 values"), ("X", 1, 1, "it lies in the array")],
)
def test_a_wrong_number_of_values_or_an_element_is_refused(fmu, name, more, count, words):
    told = []
    instance, vr = opened(fmu)
    instance.freeInstance()
    instance, vr = opened(fmu)
    instance.instantiate(loggingOn=True, logMessage=lambda *a: told.append(a[-1].decode()))
    with pytest.raises(FMICallException):
        instance.getFloat64([vr[name] + more], count)
    assert words in told[-1]


def test_directional_derivatives_take_arrays(fmu):
    instance, vr = opened(fmu, FMU3Model)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    seed = np.arange(1.0, 7.0)
    found = instance.getDirectionalDerivative([vr["der(X)"], vr["z"]], [vr["X"]], seed.tolist(), 7)
    np.testing.assert_allclose(found, [*(A @ seed.reshape(2, 3)).ravel(), seed[0]])
    back = instance.getAdjointDerivative([vr["y"]], [vr["X"], vr["u"]], [1.0, 10.0], 8)
    np.testing.assert_allclose(back, [1, 1, 0, 10, 10, 0, 0, 0])
    instance.terminate()
    instance.freeInstance()


def test_our_importer_gives_the_names_units_and_equations_of_the_block(fmu):
    block = matrix_block()
    model = hc.fmi.load(fmu, kind="ModelExchange")
    try:
        assert model.state_labels == [s.name for s in block.states]
        assert model.units["X[2,3]"] == "s" and model.units["y[1]"] == "m"
        assert model.descriptions["y[2]"] == "row 2"
        assert model.params["matrix.A[2,1]"] == A[1, 0]
        found = control.linearize(model, X0.ravel(), U)
        want = np.kron(A, np.eye(3))
        np.testing.assert_allclose(found.A, want, atol=1e-9)
        moved = control.linearize(model, X0.ravel(), U, params={"matrix.A[2,1]": 4.0})
        assert moved.A[3, 0] == pytest.approx(4.0)
        response = model.simulate([0.0, 1.0], np.tile(U[:, None], 2), rtol=1e-9)
        np.testing.assert_allclose(response.states[:, -1].reshape(2, 3), exact(1.0), atol=1e-6)
    finally:
        model.close()


def test_an_index_alone_and_a_name_that_is_taken_stay_scalars(tmp_path):
    p, q, r = hc.Signal("P[1]"), hc.Signal("Q[1]"), hc.Signal("Q[2]", lower=0.0)
    one, two, name = hc.Signal("R[1]"), hc.Signal("R[2]"), hc.Signal("R")
    block = hc.Block(
        "b", inputs=(p, q, r, one, two, name), outputs=(hc.Signal("y"),), output_expressions={"y": p.symbol}
    )
    path = block.to_fmu(tmp_path / "b.fmu", arrays=True)
    assert set(shapes(path)) >= {"P[1]", "Q[1]", "Q[2]", "R[1]", "R[2]", "R"}
