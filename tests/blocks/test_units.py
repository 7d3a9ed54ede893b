"""Physical dimensions: what may be added to what on a hovercraft."""

import numpy as np
import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.sgn import sgn
from hovercontrol.blocks.units import (
    DIMENSIONLESS,
    DimensionChecker,
    UnitError,
    conversion,
    conversion_factor,
    dimension,
    is_plain_si,
    simplified,
    unit_text,
)

U, V, R, PSI, M = sp.symbols("u v r psi m", real=True)
CHECK = {
    U: dimension("m/s"),
    V: dimension("m/s"),
    R: dimension("rad/s"),
    PSI: dimension("rad"),
    M: dimension("kg"),
}


def of(expression: sp.Expr):
    return DimensionChecker(CHECK)(expression)


def test_angles_have_no_dimension_but_velocities_do():
    assert dimension("rad/s") == dimension("1/s")
    assert dimension("m/s") != dimension("rad/s")


@settings(max_examples=8)
@given(st.lists(st.fractions(-3, 3, max_denominator=3), min_size=7, max_size=7))
def test_the_text_of_a_dimension_reads_back_as_the_same_dimension(exponents):
    dims = tuple(sp.Rational(e.numerator, e.denominator) for e in exponents)
    assert dimension(unit_text(dims)) == dims


@pytest.mark.parametrize("unit", ["furlong_per_moon", "m/", "2*m", "m^s", "__import__('os')", None])
def test_an_unknown_unit_is_refused_by_its_text(unit):
    with pytest.raises(InputError, match="unknown unit"):
        dimension(unit)


def test_degrees_are_converted_and_metres_are_not_seconds():
    assert conversion_factor("deg/s", "rad/s") == pytest.approx(0.017453292519943295)
    with pytest.raises(UnitError, match=r"'m'.*'s'"):
        conversion_factor("s", "m")


def test_a_number_beside_a_quantity_should_be_a_parameter():
    said = r"'u - 9.81': .*'-9.81' is in 1.*; give the number as a parameter with a unit"
    with pytest.raises(UnitError, match=said):
        of(U - 9.81)


@pytest.mark.parametrize(("unit", "here", "kelvin"), [("degC", 40.0, 313.15), ("degF", 32.0, 273.15)])
def test_temperatures_have_another_zero(unit, here, kelvin):
    factor, offset = conversion(unit, "K")
    assert factor * here + offset == pytest.approx(kelvin, rel=1e-14)
    with pytest.raises(UnitError, match=r"'K', found '.*', which has another zero"):
        conversion_factor(unit, "K")


@pytest.mark.parametrize(("unit", "target"), [("dB", "1"), ("degC/s", "K/s")])
def test_what_no_factor_converts_is_refused(unit, target):
    with pytest.raises(UnitError, match="another scale"):
        conversion(unit, target)


@pytest.mark.parametrize(("unit", "target"), [("Hz", "rad/s"), ("rpm", "Hz"), ("1/(rad/s)", "1/kHz")])
def test_turns_and_angles_are_not_converted_as_one(unit, target):
    """A frequency of 1 Hz is 2 pi rad/s; a factor of 1 would be wrong without a word."""
    with pytest.raises(UnitError, match="a turn a second is 'rps', 2 pi rad/s"):
        conversion(unit, target)
    assert conversion("rps", "rad/s")[0] == pytest.approx(2 * np.pi) and conversion("Hz", "1/s")[0] == 1.0


@pytest.mark.parametrize(("unit", "newton_metres"), [("Nm", 1.0), ("kNm", 1e3), ("mNm", 1e-3)])
def test_torques_are_read_as_logs_write_them(unit, newton_metres):
    assert conversion(unit, "N*m") == (pytest.approx(newton_metres), 0.0)


@pytest.mark.parametrize(
    "unit", ["1", "", "rad", "m/s^2", "N", "N*m", "A", "kg*m^2", "Hz", "m^(1/2)", "(m/s)^2*s"]
)
def test_si_units_have_no_factor(unit):
    assert is_plain_si(unit)


@pytest.mark.parametrize("unit", ["deg", "km", "g", "ms", "rpm", "%", "degC", "dB", "kN"])
def test_scaled_and_shifted_units_are_not_plain_si(unit):
    assert not is_plain_si(unit)


def test_adding_surge_to_yaw_rate_is_an_error_that_names_the_expression_and_both_units():
    with pytest.raises(UnitError, match=r"'r \+ u'.*m/s.*1/s|'r \+ u'.*1/s.*m/s"):
        of(U + R)


@pytest.mark.parametrize(
    "wrong",
    [
        sp.Max(U, R),
        sp.Min(U, R),
        sp.atan2(U, R),
        sgn(U, R),
        sp.sin(U),
        sp.exp(M),
        sp.sqrt(U) + U,
        U + 1,
        sp.Piecewise((U, U > R), (V, True)),
        sp.Piecewise((U, U > V), (R, True)),
        2**U,
        U**R,
        sp.sin(PSI) * (U + V * R),
        sp.Piecewise((U, sp.And(U > 0, R > M)), (V, True)),
    ],
)
def test_what_does_not_fit_is_refused_however_deep_it_hides(wrong):
    with pytest.raises(UnitError):
        of(wrong)


@pytest.mark.parametrize(
    ("right", "unit"),
    [
        (U * R + V * R, "m/s^2"),
        (sp.sqrt(U**2 + V**2), "m/s"),
        (sp.Abs(U) * U, "m^2/s^2"),
        (sp.atan2(U, V), "rad"),
        (sgn(U, V), "1"),
        (sp.sign(U), "1"),
        (sp.Heaviside(U), "1"),  # the derivative of max(0, U)
        (sp.Max(U, 0), "m/s"),
        (sp.cos(PSI) * U - sp.sin(PSI) * V, "m/s"),
        (sp.Piecewise((U, (U > 0) & (R < 0)), (0, True)), "m/s"),
        (M * U**2 / 2, "J"),
        (1 / R, "s"),
        (sp.exp(-((U / V) ** 2)), "1"),
        (2 ** (U / V), "1"),
        (sp.sqrt(M), "kg^(1/2)"),
        (sp.Piecewise((U, True), (V, False)), "m/s"),
    ],
)
def test_the_unit_of_a_sound_expression_is_derived(right, unit):
    assert of(right) == dimension(unit)


def test_zero_fits_every_unit():
    assert of(sp.S.Zero) is None
    assert of(sp.pi) == DIMENSIONLESS


def test_what_has_no_known_unit_is_refused():
    with pytest.raises(UnitError, match="cannot be derived"):
        of(sp.Symbol("unheard_of", real=True))


@pytest.mark.parametrize(
    ("unit", "shown"),
    [
        ("(N/V)/(kg)", "N/V/kg"),  # a gain over a mass: no base units where they are no shorter
        ("(N*m/A)/(kg*m^2)", "1/s^2/A"),
        ("(N*s/m)/(kg)", "1/s"),
        ("(N)/(m/s)", "N*s/m"),
        ("(m/s)/s", "m/s^2"),
        ("(rad/s)*(rad)", "rad^2/s"),
        ("(m)/s^(1/2)", "m/s^(1/2)"),
        ("(K)*s", "K*s"),
        ("(A)/(A)", "1"),
    ],
)
def test_a_product_is_shown_in_the_units_that_are_written(unit, shown):
    assert simplified(unit) == shown
    if shown != "1":
        assert conversion_factor(unit, simplified(unit)) == pytest.approx(1.0)
