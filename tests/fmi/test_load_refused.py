"""Files that are no FMU, or none for this machine: one line each, and nothing is left behind."""

import os
import subprocess
import zipfile

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.fmi import load

from .probe import binary, description, write_fmu

# --- FMUs that are none ---


def test_the_step_is_the_fmus_or_must_be_given(probe):
    assert probe(step=0.02).dt == 0.02 and probe().dt == 0.1
    assert probe(preferred=None, step=0.3).dt == 0.3
    for step in (0, -1, np.nan, np.inf, "fast", True):
        with pytest.raises(InputError, match=r"step( .s. must be a positive|: expected a) number"):
            probe(step=step)


def test_a_fixed_internal_step_of_fmi_3_is_the_default_and_the_measure(probe):
    fixed = {"preferred": None, "attributes": 'fixedInternalStepSize="0.05"'}
    assert probe(3, **fixed).dt == 0.05
    assert probe(3, step=0.2, **fixed).dt == 0.2
    for step in (0.07, 0.01):
        with pytest.raises(InputError, match=r"must be a multiple of the FMU's own 0.05 s"):
            probe(3, step=step, **fixed)


@pytest.mark.parametrize("name", ["a.b", "", 3])
def test_a_name_with_dots_is_refused(probe, name):
    with pytest.raises(InputError, match=r"expected a system name without dots|name: expected a text"):
        probe(name=name)


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_fmu_for_other_uses_or_platforms_is_refused(fmu, library, tmp_path, fmi):
    with pytest.raises(InputError, match="is an FMU for Model Exchange only; expected one for Co-Simulation"):
        load(fmu(fmi, kind="ModelExchange"), kind="CoSimulation")
    path = tmp_path / "other.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(fmi))
        archive.writestr("binaries/win64/probe.dll", b"")
        archive.writestr("binaries/x86_64-darwin/probe.dylib", b"")
    with pytest.raises(
        InputError, match=r"no binary for this platform .*; those it has: win64, x86_64-darwin"
    ):
        load(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", description(fmi))
        archive.writestr("sources/all.c", b"")
    with pytest.raises(InputError, match=r"no binary for this platform .*; it has no binary"):
        load(path)


@pytest.mark.parametrize(
    "old, new, line",
    [
        ('fmiVersion="2.0"', 'fmiVersion="1.0"', "is an FMU of FMI 1.0; expected FMI 2.0 or 3.0"),
        ('fmiVersion="2.0"', "", "is not an FMI model description"),
        ("fmiModelDescription", "somethingElse", "is not an FMI model description"),
        ("</ModelVariables>", "", "modelDescription.xml is not XML: mismatched tag: line"),
        ('causality="output"', 'causality="outcome"', r"violates FMI 2.0: ERROR \(line .*outcome"),
        ('valueReference="10"', 'valueReference="-1"', "violates FMI 2.0"),
        ('name="x"', 'name="u"', "violates FMI 2.0: .*not unique"),
        ('<Unknown index="2"', '<Unknown index="999"', "cannot be read"),
        (
            'modelIdentifier="probe"',
            'modelIdentifier="../../probe"',
            "'../../probe' is not an identifier of C",
        ),
        ('modelIdentifier="probe"', 'modelIdentifier="/lib/libc"', "'/lib/libc' is not an identifier of C"),
        (' unit="N"', ' unit="kN"', "violates FMI 2.0"),
    ],
)
def test_a_description_that_breaks_the_standard_is_refused(library, tmp_path, old, new, line):
    path = tmp_path / "broken.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        text = description(2)
        assert old in text
        archive.writestr("modelDescription.xml", text.replace(old, new))
        archive.write(library, binary(2))
    with pytest.raises(InputError, match=line) as caught:
        load(path)
    assert "\n" not in str(caught.value) and str(path) in str(caught.value)


def test_a_huge_array_is_refused_before_it_is_made(fmu):
    text = (
        '<Float64 name="big" valueReference="38" causality="output"><Dimension start="4000000000"/></Float64>'
    )
    with pytest.raises(InputError, match="more than 100000 signals and parameters"):
        load(fmu(3, extra=text))


@pytest.mark.parametrize("isolated", [False, True], ids=["here", "isolated"])
def test_a_binary_that_cannot_be_loaded_is_one_line(compiler, tmp_path, temporary, isolated):
    source = tmp_path / "empty.c"
    source.write_text("int nothing;")
    subprocess.run([*compiler, "-shared", "-fPIC", source, "-o", tmp_path / "empty.so"], check=True)
    here = os.getcwd()
    for library, line in (
        (b"no library", "its binary cannot be loaded: .*probe"),
        (tmp_path / "empty.so", "its binary cannot be loaded: .*fmi2GetTypesPlatform|undefined symbol: fmi2"),
    ):
        path = write_fmu(tmp_path / "bad.fmu", library)
        with pytest.raises(InputError, match=line) as caught:
            load(path, isolated=isolated)
        assert str(caught.value).startswith(f"{path}: ") and "\n" not in str(caught.value)
    assert os.getcwd() == here and list(temporary.iterdir()) == []


def test_nothing_is_left_behind_where_load_refuses(fmu, temporary):
    for given in ({"name": "a.b"}, {"step": -1}, {"params": {"nothing": 1.0}}, {"timeout": 0}):
        with pytest.raises(InputError):
            load(fmu(), **given)
    assert list(temporary.iterdir()) == []
