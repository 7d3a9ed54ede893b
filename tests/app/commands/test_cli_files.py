"""What commands do to the user's files where the disk, or the home directory, cannot be written."""

import os
import subprocess
import sys

import pytest

from hovercontrol.documents.samples import sample_path

RUN = [sys.executable, "-m", "hovercontrol"]
COMMANDS = {
    "simulate": ["simulate", "k06-turn", "--out", "new/deep"],
    "sweep": ["sweep", "k06-turn", "--vary", "controller.k2=0.5:6:4", "--out", "new/deep"],
    "check": ["check", str(sample_path()), "--out", "new/deep"],
    "export": ["export", "k06-turn:plant", "-o", "new/deep/plant.fmu"],
    "new": ["new", "new/deep/craft.toml"],
    "identify": ["identify", "--sample", "--out", "new/deep"],
    "analyze": ["analyze", "c17_beta_region", "--out", "new/deep"],
    "diagnose": [
        "diagnose",
        str(sample_path()),
        "--vehicle",
        "c17_experiment",
        "--effects",
        "slope",
        "--out",
        "new/deep",
    ],
    "items": ["analyze", "c17 figure 2", "--out", "new/deep"],
}


@pytest.fixture
def full_disk(tmp_path, monkeypatch):
    """Let nothing in this folder get its final name."""

    def refuse(real):
        def change(source, target, **given):
            if os.fspath(target).startswith(str(tmp_path)) or not os.path.isabs(os.fspath(target)):
                raise OSError(28, "No space left on device", os.fspath(target))
            return real(source, target, **given)

        return change

    for name in ("rename", "replace"):
        monkeypatch.setattr(os, name, refuse(getattr(os, name)))


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=[] if n in ("check", "export", "new", "sweep") else pytest.mark.slow)
        for n in COMMANDS
    ],
)
def test_a_full_disk_is_one_line_and_leaves_nothing(call, tmp_path, full_disk, name):
    done = call(*COMMANDS[name], cwd=tmp_path)
    said = [line for line in done.stderr.splitlines() if line.startswith("hovercontrol:")]
    assert done.returncode == 2 and done.stdout == "" and len(said) == 1, done.stderr
    assert "cannot be written: No space left on device" in said[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_home_that_cannot_be_written_is_not_spoken_of(tmp_path):
    places = {name: "/dev/null/x" for name in ("HOME", "XDG_CONFIG_HOME", "XDG_CACHE_HOME")}
    environment = {k: v for k, v in os.environ.items() if k != "MPLCONFIGDIR"} | places
    environment |= {"TMPDIR": str(tmp_path)}
    words = [*RUN, "simulate", "k06-turn", "--out", "out"]
    done = subprocess.run(
        words, env=environment, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=True
    )
    assert [line for line in done.stderr.splitlines() if not line.startswith("simulate k06-turn")] == []
    assert [p.name for p in tmp_path.iterdir()] == ["out"], "no temporary folder is left"


def test_matplotlibs_own_folder_is_kept_where_it_can_be_written(tmp_path, monkeypatch):
    from hovercontrol.base.matplotlib_folder import set_matplotlib_folder

    monkeypatch.setenv("MPLCONFIGDIR", str(tmp_path / "new" / "folder"))
    set_matplotlib_folder()
    assert os.environ["MPLCONFIGDIR"] == str(tmp_path / "new" / "folder")
    monkeypatch.setenv("MPLCONFIGDIR", "/dev/null/x")
    set_matplotlib_folder()
    assert os.path.isdir(os.environ["MPLCONFIGDIR"])
