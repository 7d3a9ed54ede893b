"""Shell completion knows every command, option and name; in bash it is pressed."""

import shutil
import subprocess

import pytest
import typer

from hovercontrol import InputError
from hovercontrol.commands.app import app
from hovercontrol.commands.completion import script

ROOT = typer.main.get_command(app)


def shown(command):
    return [n for p in command.params if p.param_type_name == "option" and not p.hidden for n in p.opts]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_every_command_and_option_is_in_every_script(shell):
    text = script(shell, ROOT)
    for name, command in ROOT.commands.items():
        assert name in text
        for option in shown(command):
            wanted = option if shell != "fish" else option.lstrip("-")
            assert wanted in text, (name, option)
    assert "four_fan" in text and "table1" in text and "--allow-gaps" not in text
    if shutil.which(shell):
        subprocess.run([shell, "-n"], input=text, text=True, check=True, timeout=20)


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash on this machine")
@pytest.mark.parametrize(
    ("typed", "offered"),
    [
        (["sim"], {"simulate"}),
        (["--ver"], {"--version"}),
        (["simulate", "table"], {"table1", "table1-transient", "table2", "table2-outliers"}),
        (["simulate", "--o"], {"--out"}),
        (["identify", "a.csv", "--vehicle", "four"], {"four_fan"}),
        (["--completion", ""], {"bash", "zsh", "fish"}),
        (["export", "--fmi", ""], {"2", "3"}),
        (["diagnose", "--out", "t"], set()),  # the shell's own files
    ],
)
def test_bash_offers_what_fits(typed, offered, tmp_path):
    words = " ".join(f"'{w}'" for w in ["hovercontrol", *typed])
    press = f'\nCOMP_WORDS=({words}); COMP_CWORD={len(typed)}; _hovercontrol; echo "${{COMPREPLY[@]}}"'
    done = subprocess.run(
        ["bash", "-c", script("bash", ROOT) + press], capture_output=True, text=True, timeout=20, cwd=tmp_path
    )
    assert done.stderr == "" and set(done.stdout.split()) == offered


def test_another_shell_is_refused_in_one_line():
    with pytest.raises(InputError, match="unknown shell 'fsh'; did you mean 'fish'"):
        script("fsh", ROOT)
