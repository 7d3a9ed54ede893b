"""Shell completion offers every command, option and name; Typer writes the scripts."""

import os
import shutil
import subprocess
import sys
import unittest.mock

import pytest
import shellingham
import typer
from typer.testing import CliRunner

from hovercontrol.app.commands import names
from hovercontrol.app.commands.app import app
from hovercontrol.app.schema import KINDS as SCHEMAS
from hovercontrol.blocks.backends.sweep import FIGURES
from hovercontrol.craft.effects import effect_names
from hovercontrol.craft.models.template import KINDS
from hovercontrol.documents.scenarios import scenario_names

ROOT = typer.main.get_command(app)


def offered(*typed):
    """What bash gets when Tab is pressed after these words, the last of which may be unfinished."""
    words = {"COMP_WORDS": " ".join(["hovercontrol", *typed]), "COMP_CWORD": str(len(typed))}
    done = CliRunner().invoke(
        app, env=words | {"_HOVERCONTROL_COMPLETE": "complete_bash"}, prog_name="hovercontrol"
    )
    assert done.exit_code == 0 and done.stderr == ""
    return set(done.stdout.split())


def test_every_command_and_its_options_are_offered():
    assert offered("") == set(ROOT.commands)
    for name, command in ROOT.commands.items():
        options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
        assert {n for p in options for n in p.opts if n.startswith("--")} <= offered(name, "--"), name
    assert "--allow-gaps" not in offered("check", "--")


@pytest.mark.parametrize(
    ("typed", "found"),
    [
        (["sim"], {"simulate"}),
        (["--ver"], {"--version"}),
        (["simulate", "table"], {"table1", "table1-transient", "table2", "table2-outliers"}),
        (["simulate", "--json", "table1-"], {"table1-transient"}),
        (["simulate", "--o"], {"--out"}),
        (["simulate", "--out", "a", "--out", "b", "--par"], {"--params"}),
        (["sweep", ""], set(scenario_names())),
        (["sweep", "--figure", ""], set(FIGURES)),
        (["identify", "a.csv", "--vehicle", "four"], {"four_fan"}),
        (["check", "--vehicle", "four"], {"four_fan"}),
        (["cockpit", "--vehicle", "four"], {"four_fan"}),
        (["diagnose", "--effects", "slope,win"], {"slope,wind"}),
        (["monitor", "--candidates", "slope,win"], {"slope,wind"}),
        (["monitor", "--vehicle", "four"], {"four_fan"}),
        (["export", "four"], {"four_fan"}),
        (["export", "table2-"], {"table2-outliers"}),
        (["export", "--fmi", ""], {"2", "3"}),
        (["export", "--platforms", "x86_64-linux,al"], {"x86_64-linux,all"}),
        (["export", "--friction", ""], {"events", "smooth"}),
        (["analyze", "c17_gain_r"], {"c17_gain_region"}),
        (["new", "--kind", ""], set(KINDS)),
        (["schema", ""], set(SCHEMAS)),
        (["diagnose", "--out", "t"], set()),  # the shell's own files
    ],
)
def test_what_fits_is_offered(typed, found):
    assert offered(*typed) == found


def test_every_effect_is_offered():  # those that other tests have registered, too
    assert offered("diagnose", "--effects", "") == set(effect_names())


def test_the_scenarios_are_those_of_the_package():
    assert names.scenarios() == scenario_names()


#: What a script contains only of its own shell.
OWN = {"bash": "COMPREPLY", "zsh": "#compdef", "fish": "complete --command", "pwsh": "Register-Argument"}
SHOW = f"{sys.executable} -m hovercontrol --show-completion"


@pytest.mark.parametrize("shell", OWN)
def test_the_script_is_that_of_the_shell_named_whatever_shell_runs_it(call, monkeypatch, shell):
    """Typer's own option prints nothing where a parent is dash, and the parent's script elsewhere."""
    nowhere = unittest.mock.Mock(side_effect=shellingham.ShellDetectionFailure)
    for found in (("sh", "/bin/sh"), ("fish", "/usr/bin/fish"), nowhere):
        detected = found if callable(found) else lambda *_, found=found: found
        monkeypatch.setattr(shellingham, "detect_shell", detected)
        done = call("--show-completion", shell)
        assert (done.returncode, done.stderr) == (0, "")
        assert "_HOVERCONTROL_COMPLETE" in done.stdout
        assert [name for name, text in OWN.items() if text in done.stdout] == [shell]
    if shell != "pwsh" and shutil.which(shell):
        subprocess.run([shell, "-n"], input=done.stdout, text=True, check=True, timeout=20)


def test_a_makefile_gets_the_script(tmp_path):
    """make hands a line with quotes, as those of `make test`, to /bin/sh."""
    line = f"true && {SHOW} 'bash'; exit $?"
    (tmp_path / "Makefile").write_text(f"all:\n\t@{line.replace('$', '$$')}\n")
    for words in (["make", "-s"], ["sh", "-c", line]):
        done = subprocess.run(words, cwd=tmp_path, env=os.environ | {"MAKEFLAGS": ""}, capture_output=True)
        assert done.returncode == 0 and b"COMPREPLY" in done.stdout, done.stderr


def test_it_is_installed_for_the_shell_named(call, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setattr(shellingham, "detect_shell", lambda *_: ("sh", "/bin/sh"))
    assert call("--install-completion", "zsh").returncode == 0
    assert OWN["zsh"] in (tmp_path / ".zfunc" / "_hovercontrol").read_text()
    for shell in ("tcsh", ""):
        done = call("--install-completion", shell)
        assert done.returncode == 2 and f"'{shell}' is not one of 'bash', 'zsh'" in done.stderr
