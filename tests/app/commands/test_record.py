"""Each command does with a small fixed input what it did when `recorded.json` was written."""

import json
from pathlib import Path

import pytest

from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler

from .record import COMMANDS, NEEDS, SLOW, files_of, told

RECORDED = json.loads(Path(__file__).with_name("recorded.json").read_text(encoding="utf-8"))


def test_every_command_is_recorded():
    assert set(RECORDED) == set(COMMANDS)


@pytest.mark.slow(*SLOW)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_does_what_was_recorded(call, tmp_path, name):
    if name == "export":
        try:
            find_compiler()
        except NoCompilerError as error:
            pytest.skip(f"{error}: no FMU can be made")
    if name in NEEDS:
        assert call(*COMMANDS[NEEDS[name]], cwd=tmp_path).returncode == 0
    before = files_of(tmp_path)
    done = call(*COMMANDS[name], cwd=tmp_path)
    found, wanted = told(name, done.returncode, done.stdout, tmp_path, before), RECORDED[name]
    assert found["status"] == wanted["status"], done.stderr
    assert found["files"] == wanted["files"]
    missing, further = (set(a["figures"]) - set(b["figures"]) for a, b in ((wanted, found), (found, wanted)))
    assert not missing
    assert not further or name == "schema", "effects of other tests of this process are in the schema, too"
    for key, value in wanted["figures"].items():  # the last digits differ from machine to machine
        assert found["figures"][key] == pytest.approx(value, rel=2e-2, abs=1e-6), key
