"""What `load` makes of systems of FMUs as other tools write them: SSP 1.0 and 2.0, by hand."""

import zipfile

import control as ct
import numpy as np
import pytest

import hovercontrol as hc
from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load

SPACES = " ".join(
    f'xmlns:{short}="http://ssp-standard.org/SSP1/SystemStructure{name}"'
    for short, name in (
        ("ssd", "Description"),
        ("ssc", "Common"),
        ("ssv", "ParameterValues"),
        ("ssm", "ParameterMapping"),
    )
)
UNITS = (
    '<ssd:Units><ssc:Unit name="m/s"><ssc:BaseUnit m="1" s="-1"/></ssc:Unit>'
    '<ssc:Unit name="kmh"><ssc:BaseUnit m="1" s="-1" factor="0.25"/></ssc:Unit>'
    '<ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>'
    '<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit></ssd:Units>'
)


@pytest.fixture(scope="module")
def gain(tmp_path_factory):
    """y = k u + c, with u = 5 where nothing sets it."""
    y, u = hc.Signal("y"), hc.Signal("u", start=5.0)
    k, c = hc.Signal("k", start=2.0), hc.Signal("c")
    block = hc.Block("gain", [], [u], [y], [k, c], {}, {"y": k.symbol * u.symbol + c.symbol})
    return block.to_fmu(tmp_path_factory.mktemp("gain") / "gain.fmu", version=2)


def connectors(*each):
    """Connectors from texts like ``input u kmh``."""
    found = ""
    for kind, name, *unit in map(str.split, each):
        units = f' unit="{unit[0]}"' if unit else ""
        found += f'<ssd:Connector name="{name}" kind="{kind}"><ssc:Real{units}/></ssd:Connector>'
    return f"<ssd:Connectors>{found}</ssd:Connectors>"


def part(name, unit_in="", unit_out="", more=""):
    ports = connectors(f"input u {unit_in}", f"output y {unit_out}")
    return f'<ssd:Component name="{name}" source="resources/gain.fmu">{ports}{more}</ssd:Component>'


def wire(start, end, inside="", more=""):
    ends = ""
    for which, text in (("start", start), ("end", end)):
        element, name = text.split(".", 1) if "." in text else ("", text)
        ends += f' {which}Element="{element}"' if element else ""
        ends += f' {which}Connector="{name}"'
    return f"<ssd:Connection{ends}{more}>{inside}</ssd:Connection>"


def system(elements, *wires, ports=(), name="s", more=""):
    return (
        f'<ssd:System name="{name}">{connectors(*ports) if ports else ""}{more}<ssd:Elements>{elements}'
        f"</ssd:Elements><ssd:Connections>{''.join(wires)}</ssd:Connections></ssd:System>"
    )


def values(*pairs, more="", mapping="", prefix=""):
    rows = "".join(
        f'<ssv:Parameter name="{n}"><ssv:Real value="{v}"{more}/></ssv:Parameter>' for n, v in pairs
    )
    return (
        f"<ssd:ParameterBindings><ssd:ParameterBinding{prefix}><ssd:ParameterValues><ssv:ParameterSet "
        f'version="1.0" name="v"><ssv:Parameters>{rows}</ssv:Parameters></ssv:ParameterSet>'
        f"</ssd:ParameterValues>{mapping}</ssd:ParameterBinding></ssd:ParameterBindings>"
    )


@pytest.fixture
def result(gain, tmp_path):
    """Load a system and return its outputs by name, at w = 3 where it has an input w."""

    def of(text, units="", version="1.0", files=None, file="s.ssp"):
        path = tmp_path / file
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr(
                "SystemStructure.ssd",
                (
                    f'<ssd:SystemStructureDescription {SPACES} version="{version}" name="s">{text}{units}'
                    "</ssd:SystemStructureDescription>"
                ),
            )
            archive.write(gain, "resources/gain.fmu")
            for name, content in (files or {}).items():
                archive.writestr(name, content)
        whole = load(path)
        inputs = np.full((whole.ninputs, 2), 3.0)
        found = ct.input_output_response(whole, np.array([0.0, whole.dt]), inputs, squeeze=False).outputs
        return dict(zip(whole.output_labels, found[:, -1], strict=True))

    return of


W_TO_A, A_TO_B = wire("w", "a.u"), wire("a.y", "b.u")
IN, OUT = "input w", "output z"
FACTOR = '<ssc:LinearTransformation factor="10" offset="-1"/>'


@pytest.mark.parametrize(
    ("text", "want"),
    [
        (
            system(part("a") + part("b"), W_TO_A, wire("a.y", "b.u", FACTOR), ports=[IN]),
            {"a_y": 6, "b_y": 118},
        ),
        (system(part("a") + part("b"), W_TO_A, wire("b.u", "a.y"), ports=[IN]), {"a_y": 6, "b_y": 12}),
        (system(part("a", "", "m/s") + part("b", "kmh"), W_TO_A, A_TO_B, ports=[IN]), {"a_y": 6, "b_y": 48}),
        (
            system(
                part("a", "", "m/s") + part("b", "kmh"),
                W_TO_A,
                wire("a.y", "b.u", FACTOR, ' suppressUnitConversion="true"'),
                ports=[IN],
            ),
            {"a_y": 6, "b_y": 118},
        ),
        (
            system(part("a", "", "degC") + part("b", "K"), W_TO_A, A_TO_B, ports=[IN]),
            {"a_y": 6, "b_y": 558.3},
        ),
        (system(part("a"), W_TO_A, wire("a.y", "z", FACTOR), ports=[IN, OUT]), {"z": 59}),
        (system(part("a"), wire("w", "a.u", FACTOR), wire("a.y", "z"), ports=[IN, OUT]), {"z": 58}),
        (system(part("a"), W_TO_A, wire("w", "z"), ports=[IN, OUT]), {"z": 3}),
        (system(part("a")), {"y": 10}),  # an input that nothing sets keeps its start value
        (system(part("a", more=values(("u", 4)))), {"y": 8}),
        (system(part("a", more=values(("gain.k", 7), ("gain.c", 1)))), {"y": 36}),
        (system(part("a", more=values(("gain.k", 7))), more=values(("a.gain.k", 3))), {"y": 15}),
        (
            system(part("a"), more=values(("gain.k", 3), prefix=' prefix="a."')),
            {"y": 15},
        ),
    ],
)
def test_connections_and_values_act_as_the_standard_says(result, text, want):
    assert result(text, UNITS) == pytest.approx(want)


def test_nested_systems_and_their_values(result):
    inner = system(
        part("a"),
        wire("in", "a.u"),
        wire("a.y", "out"),
        wire("g", "a.gain.k"),
        ports=["input in kmh", "output out", "parameter g"],
        name="deep",
        more=values(("g", 4), ("a.gain.c", 1)),
    )
    outer = [IN + " m/s", OUT]
    text = system(inner, wire("w", "deep.in"), wire("deep.out", "z"), ports=outer)
    assert result(text, UNITS) == pytest.approx({"z": 4 * 12 + 1})
    higher = system(
        inner, wire("w", "deep.in"), wire("deep.out", "z"), ports=outer, more=values(("deep.a.gain.c", 2))
    )
    assert result(higher, UNITS) == pytest.approx({"z": 4 * 12 + 2})
    head = f'<ssd:SystemStructureDescription {SPACES} version="2.0" name="i">'
    file = f"{head}{inner}{UNITS}</ssd:SystemStructureDescription>"
    other = '<ssd:Component name="deep" type="application/x-ssp-definition" source="inner.ssd"/>'
    assert result(text.replace(inner, other), UNITS, "2.0", {"inner.ssd": file}) == pytest.approx({"z": 49})


def test_a_parameter_mapping_renames_and_converts(result):
    entries = (
        '<ssm:MappingEntry source="kk" target="gain.k"><ssc:LinearTransformation factor="0.5"/>'
        "</ssm:MappingEntry>"
        '<ssm:MappingEntry source="kk" target="gain.c"/>'
    )
    text = f'<ssm:ParameterMapping {SPACES} version="1.0">{entries}</ssm:ParameterMapping>'
    bound = system(
        part("a", more=values(("kk", 6), ("gain.k", 99), mapping='<ssd:ParameterMapping source="m.ssm"/>'))
    )
    assert result(bound, files={"m.ssm": text}) == pytest.approx({"y": 21})
    inside = values(("kk", 6), mapping=f"<ssd:ParameterMapping>{text}</ssd:ParameterMapping>")
    assert result(system(part("a", more=inside)), file="a.b.ssp") == pytest.approx({"y": 21})


def test_a_value_for_nothing_and_a_unit_that_nothing_defines_are_warnings(result):
    with pytest.warns(UserWarning, match=r"values for nothing: a\.q"):
        assert result(system(part("a", more=values(("q", 1))))) == {"y": 10}
    odd = system(part("a", "", "furlong_x") + part("b", "m/s"), W_TO_A, A_TO_B, ports=[IN])
    with pytest.warns(UserWarning, match="not converted"):
        assert result(odd, UNITS)["b_y"] == 12


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (
            system(part("a") + part("b"), W_TO_A, A_TO_B, wire("b.y", "b.u"), ports=[IN]),
            "two connections lead into 'b.u'",
        ),
        (system(part("a") + part("a")), "two elements have the name 'a'"),
        (system(part("a") + part("b"), wire("a.yy", "b.u")), "unknown connector 'a.yy'; did you mean 'y'"),
        (system(part("a") + part("b"), wire("c.y", "b.u")), "unknown connector 'c.y'"),
        (system(part("a") + part("b"), wire("a.y", "b.y")), "connection of two outputs"),
        (
            system(part("a", "", "m/s") + part("b", "K"), W_TO_A, A_TO_B, ports=[IN]),
            "'b.u' is in K, .* in m/s",
        ),
        (system(part("a", more=values(("gain.k", "x")))), "parameter 'gain.k': expected a number, found 'x'"),
        (system(part("a").replace("gain.fmu", "no.fmu")), "it holds no file"),
        (system(part("a").replace("resources/gain", "../../gain")), "it holds no file"),
        (system(part("a") + '<ssd:SignalDictionaryReference name="bus" dictionary="d"/>'), "not supported"),
    ],
)
def test_what_is_wrong_is_one_line(result, text, line):
    with pytest.raises(InputError, match=line):
        result(text, UNITS)
