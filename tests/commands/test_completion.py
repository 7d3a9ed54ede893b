"""Shell completion offers every command, option and name; Typer writes the scripts."""

import shutil
import subprocess

import pytest
import typer
from typer.testing import CliRunner

from hovercontrol.commands import names
from hovercontrol.commands.app import app
from hovercontrol.effects import effect_names
from hovercontrol.models.template import KINDS
from hovercontrol.scenarios import scenario_names
from hovercontrol.schema import KINDS as SCHEMAS
from hovercontrol.targets.sweep import FIGURES

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


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_each_shell_is_valid(shell):
    text = CliRunner().invoke(app, ["--show-completion", shell], prog_name="hovercontrol").stdout
    assert "_HOVERCONTROL_COMPLETE" in text
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=text, text=True, check=True, timeout=20)
