"""The .fmu as a whole: the same bytes twice, complete, correct in another tool, never half-written."""

import csv
import io
import os
import shutil
import subprocess
import sys
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

import hovercontrol
from hovercontrol import InputError, vehicle
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler
from hovercontrol.fmi.exporter.binaries import this_platform

from .blocks import BLOCKS, exported

try:
    COMPILER = find_compiler()
except NoCompilerError:
    pytest.skip("no C compiler on this machine", allow_module_level=True)


def read(path, name):
    with zipfile.ZipFile(path) as archive:
        return archive.read(name)


def names(path):
    with zipfile.ZipFile(path) as archive:
        return archive.namelist()


@pytest.mark.parametrize("version", [2, 3])
def test_fmpy_finds_nothing_wrong_in_a_whole_fmu(version):
    """With each Block's description: test_description.py."""
    assert validate_fmu(str(exported("plant", version))) == []


@pytest.mark.slow
def test_another_process_in_another_folder_with_an_empty_cache_writes_the_same_bytes(tmp_path):
    code = """import hovercontrol
plant = hovercontrol.vehicle('four_fan').plant()
for version in (2, 3):
    plant.to_fmu(f'craft{version}.fmu', version=version)
"""
    folder = tmp_path / "folder" / "deep"
    folder.mkdir(parents=True)
    own = {"HOVERCONTROL_CACHE": str(tmp_path / "cache"), "PYTHONHASHSEED": "1", "TZ": "Asia/Tokyo"}
    subprocess.run([sys.executable, "-c", code], check=True, cwd=folder, env={**os.environ, **own})
    for version in (2, 3):
        here = vehicle("four_fan").plant().to_fmu(tmp_path / f"craft{version}.fmu", version=version)
        assert here.read_bytes() == (folder / f"craft{version}.fmu").read_bytes()


def test_the_token_follows_the_content(tmp_path):
    def token(block, **options):
        path = block.to_fmu(tmp_path / "x.fmu", **options)
        return fmpy.read_model_description(path).instantiationToken

    plant = vehicle("four_fan").plant()
    assert token(plant) == token(plant)
    other = plant.with_values({"plant.fan_force": 6.0})
    craft = vehicle("c17_simulation").plant()
    assert token(plant) != token(other)
    assert token(craft) != token(craft, friction="events")


def test_what_is_inside():
    common = {
        "modelDescription.xml",
        "documentation/index.html",
        "documentation/licenses/license.txt",
        "documentation/plant_ref.csv",
        "documentation/plant_in.csv",
        "sources/model.c",
        "sources/description.c",
    }
    two, three = names(exported("plant", 2)), names(exported("plant", 3))
    assert two[0] == three[0] == "modelDescription.xml"
    assert common | {"model.png", "sources/hc_fmi2.c"} <= set(two)
    terms = {f"terminalsAndIcons/{f}" for f in ("terminalsAndIcons.xml", "icon.png", "icon.svg")}
    assert common | terms | {"sources/buildDescription.xml", "sources/hc_fmi3.c"} <= set(three)
    assert [n for n in three if n.startswith("binaries/")] == [f"binaries/{this_platform()}/plant.so"] or (
        not sys.platform.startswith("linux")
    )
    assert not any("fmi2" in n for n in three) and not any("fmi3" in n for n in two)


def test_the_licence_is_this_projects():
    text = Path(hovercontrol.__file__).parents[1] / "LICENSE"
    if not text.exists():
        pytest.skip("no LICENSE beside the package: it is installed")
    assert read(exported("plant", 3), "documentation/licenses/license.txt") == text.read_bytes()


class Page(HTMLParser):
    """Checks that tags close, and keeps what a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.open, self.fetched, self.text, self.rows = [], [], "", 0

    def handle_starttag(self, tag, attrs):
        if tag != "meta":
            self.open.append(tag)
        self.rows += tag == "tr"
        self.fetched += [v for k, v in attrs if k in ("src", "href", "srcset")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


@pytest.mark.slow("loop", "estimator")
@pytest.mark.parametrize("name", BLOCKS)
def test_the_documentation_stands_alone_and_names_every_variable(name):
    html = read(exported(name, 3), "documentation/index.html").decode()
    page = Page()
    page.feed(html)
    assert page.open == [] and page.fetched == [] and "@import" not in html and "url(" not in html
    for v in fmpy.read_model_description(exported(name, 3)).modelVariables:
        if v.causality in ("input", "output", "parameter"):
            assert v.name in page.text
    assert "width=device-width" in html


def test_the_documentation_has_the_equations():
    html = read(exported("plant", 3), "documentation/index.html").decode()
    assert html.count("<math>") == 6 and "<mi>sgn</mi>" in html
    for part in html.split("<math>")[1:]:
        ElementTree.fromstring("<math>" + part.split("</math>")[0] + "</math>")
    assert "sticking at exactly zero" in html
    smooth = read(exported("plant", 3, "smooth"), "documentation/index.html").decode()
    assert "tanh(v/width)" in smooth
    assert "Dry friction</h2>" not in read(exported("four_fan", 3), "documentation/index.html").decode()


def columns(text):
    rows = list(csv.reader(io.StringIO(text.decode())))
    return rows[0], np.array(rows[1:], dtype=float)


@pytest.mark.slow("loop")
@pytest.mark.parametrize("version", [2, 3])
@pytest.mark.parametrize("name", ["plant", "reference", "loop", "four_fan"])
def test_another_tool_reproduces_the_reference_trajectory(name, version):
    path = exported(name, version)
    name = BLOCKS[name].name
    head, reference = columns(read(path, f"documentation/{name}_ref.csv"))
    start = {}
    if f"documentation/{name}_in.csv" in names(path):
        inputs, values = columns(read(path, f"documentation/{name}_in.csv"))
        start = dict(zip(inputs[1:], values[0, 1:], strict=True))
        assert all(start.values())
    result = fmpy.simulate_fmu(
        str(path), fmi_type="CoSimulation", start_values=start, output_interval=reference[1, 0]
    )
    found = np.column_stack([result[n] for n in head])
    np.testing.assert_allclose(found, reference, rtol=1e-4, atol=1e-5)


@pytest.mark.slow("2")
@pytest.mark.parametrize("version", [2, 3])
def test_the_sources_build_as_their_list_says(version, tmp_path):
    """As an importer does: the listed files, and nothing else, give a library that computes the same."""
    path = exported("plant", version)
    folder = Path(fmpy.extract(str(path), unzipdir=tmp_path / "fmu"))
    description = fmpy.read_model_description(folder)
    (group,) = description.buildConfigurations[0].sourceFileSets
    definitions = [f"-D{d.name}={d.value or ''}" for d in group.preprocessorDefinitions]
    before = fmpy.simulate_fmu(str(folder), start_values={"thrust": 1.0}, stop_time=1.0)
    (library,) = (folder / "binaries").glob("*/plant.*")
    library.unlink()
    call = [*COMPILER, "-std=c99", "-O1", "-ffp-contract=off", "-shared", "-fPIC", *definitions]
    call += [*group.sourceFiles, "-o", str(library), "-lm"]
    subprocess.run(call, check=True, cwd=folder / "sources")
    after = fmpy.simulate_fmu(str(folder), start_values={"thrust": 1.0}, stop_time=1.0)
    np.testing.assert_allclose(after["u"], before["u"], rtol=1e-12)


@pytest.mark.parametrize("version", [2, 3])
def test_functions_take_the_prefix_of_a_static_library(version, tmp_path):
    if shutil.which("nm") is None:
        pytest.skip("no nm on this machine")
    folder = Path(fmpy.extract(str(exported("plant", version)), unzipdir=tmp_path / "fmu")) / "sources"
    prefix = f"-DFMI{version}_FUNCTION_PREFIX=plant_"
    files = sorted(f.name for f in folder.glob(f"hc_fmi{version}*.c"))
    subprocess.run([*COMPILER, "-std=c99", "-c", prefix, *files], check=True, cwd=folder)
    call = ["nm", "-g", "--defined-only", *(f"{Path(f).stem}.o" for f in files)]
    listed = subprocess.run(call, check=True, cwd=folder, capture_output=True, text=True).stdout
    found = {line.split()[-1] for line in listed.splitlines() if " " in line}
    assert len(found) > 30 and all(name.startswith(f"plant_fmi{version}") for name in found)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"version": 1}, "version: expected 2 or 3, found 1"),
        ({"platforms": "x86_64-linx"}, "unknown platform 'x86_64-linx'; did you mean 'x86_64-linux'?"),
        ({"friction": "none"}, "friction: expected 'events' or 'smooth'"),
        ({"step": 0.0}, "step must be positive, found 0.0"),
        ({"stop": float("inf")}, "stop must be positive"),
        ({"rtol": -1.0}, "rtol must be positive"),
        ({"step": 2.0, "stop": 1.0}, "step = 2 s is longer than the experiment, 1 s"),
    ],
)
def test_wrong_arguments_are_one_line_and_nothing_is_written(options, said, tmp_path):
    with pytest.raises(InputError) as error:
        BLOCKS["plant"].to_fmu(tmp_path / "x.fmu", **options)
    assert said in str(error.value) and "\n" not in str(error.value)
    assert list(tmp_path.iterdir()) == []


def test_wrong_places_are_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.fmu").mkdir()
    for path, said in (
        ("x.zip", "ends in .fmu"),
        ("file/x.fmu", "is a file, not a folder"),
        ("folder.fmu", "found a folder"),
    ):
        with pytest.raises(InputError, match=said):
            BLOCKS["plant"].to_fmu(tmp_path / path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["file", "folder.fmu"]


def test_an_fmu_that_is_there_stays_whole_when_a_new_one_cannot_be_made(tmp_path, monkeypatch):
    path = BLOCKS["four_fan"].to_fmu(tmp_path / "x.fmu")
    before = path.read_bytes()
    monkeypatch.setenv("CC", "no-such-compiler")
    with pytest.raises(InputError, match="no-such-compiler"):
        BLOCKS["plant"].to_fmu(path)
    assert path.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["x.fmu"]


def test_progress_is_told_from_0_to_1(tmp_path):
    told = []
    BLOCKS["four_fan"].to_fmu(tmp_path / "x.fmu", progress=told.append)
    assert told == sorted(told) and 0 < told[0] <= told[-1] <= 1


def test_friction_is_by_default_as_simulate_has_it(tmp_path):
    """One default for all backends: a craft that slows down creeps, and the FMU gives those numbers."""
    plant = vehicle("c17_simulation").plant()
    path = plant.to_fmu(tmp_path / "plant.fmu", version=2, rtol=1e-9, atol=1e-12)
    times = np.linspace(0.0, 1.0, 101)
    expected = hovercontrol.simulate(plant, times, x0={"u": 0.2, "r": 0.3}, rtol=1e-10, atol=1e-12)
    found = fmpy.simulate_fmu(
        str(path),
        stop_time=1.0,
        output_interval=0.01,
        start_values={"u": 0.2, "r": 0.3},
        relative_tolerance=1e-9,
    )
    for label, values in zip(expected.state_labels, expected.states, strict=True):
        np.testing.assert_allclose(found[label], values, atol=1e-6, err_msg=label)
    late = found["u"][found["u"] < 1e-3]  # Coulomb's law would have stopped it at zero
    assert late.size and np.abs(late).max() > 1e-5
