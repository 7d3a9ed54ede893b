"""Files and folders of results are written atomically, whatever happens meanwhile."""

import os
import resource
import subprocess
import sys
import warnings

import pytest

from hovercontrol.base import files, folders
from hovercontrol.base.errors import InputError
from hovercontrol.base.file_list import LIST
from hovercontrol.base.files import check_folder, readable, write_atomically
from hovercontrol.base.folders import write_folder


def test_the_file_and_its_folder_appear(tmp_path):
    path = write_atomically(tmp_path / "new" / "model.toml", lambda p: p.write_text("[plant]\n"))
    assert path.read_text() == "[plant]\n"
    assert [p.name for p in path.parent.iterdir()] == ["model.toml"]


def test_a_failure_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise OSError("disk full")

    with pytest.raises(InputError, match=r"model\.toml: cannot be written: disk full"):
        write_atomically(path, fail)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["model.toml"]


def test_the_writer_sees_the_same_suffix(tmp_path):
    seen = []
    write_atomically(tmp_path / "log.csv", lambda p: seen.append(p.suffix))
    assert seen == [".csv"]


def test_permissions_follow_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        path = write_atomically(tmp_path / "model.toml", lambda p: p.write_text("x"))
    finally:
        os.umask(old)
    assert path.stat().st_mode & 0o777 == 0o640


# ---- folders -------------------------------------------------------------------------------------------


def results(text, *names):
    def write(folder):
        for name in names or ("a.csv", "b.csv"):
            (folder / name).write_text(text)

    return write


def content(folder):
    return {path.name: path.read_text() for path in folder.iterdir() if path.is_file() and path.name != LIST}


def test_a_folder_appears_and_is_replaced_with_what_others_put_there_kept(tmp_path):
    out = tmp_path / "new" / "out"
    assert write_folder(out, results("1")) == [out / "a.csv", out / "b.csv"]
    write_folder(out, results("1", "old_c.csv"))
    (out / "notes.txt").write_text("mine")
    write_folder(out, results("2", "a.csv"), stale=("old_*.csv",))
    assert content(out) == {"a.csv": "2", "b.csv": "1", "notes.txt": "mine"}
    assert [p.name for p in out.parent.iterdir()] == ["out"]


def test_a_folder_with_folders_and_the_one_we_are_in_are_filled(tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    write_folder(tmp_path, results("1"))
    monkeypatch.chdir(tmp_path)
    write_folder(".", results("2", "a.csv"))
    assert content(tmp_path) == {"a.csv": "2", "b.csv": "1"} and (tmp_path / "sub").is_dir()
    assert {p.name for p in tmp_path.iterdir()} == {"a.csv", "b.csv", "sub", LIST}


def test_a_link_to_a_folder_stays_one(tmp_path):
    (tmp_path / "far").mkdir()
    (tmp_path / "out").symlink_to("far")
    write_folder(tmp_path / "out", results("1"))
    assert (tmp_path / "out").is_symlink() and content(tmp_path / "far") == {"a.csv": "1", "b.csv": "1"}


def test_without_an_exchange_of_names_there_is_still_a_folder(tmp_path, monkeypatch):
    def refuse(one, other):
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(folders, "_swap", refuse)
    for text in ("1", "2"):
        write_folder(tmp_path / "out", results(text))
    assert content(tmp_path / "out") == {"a.csv": "2", "b.csv": "2"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


@pytest.mark.parametrize("as_one", [True, False])
def test_a_users_file_is_neither_removed_nor_overwritten(tmp_path, as_one):
    """A file that was not written here, one that was changed since, and a link, of names that are wanted."""
    out = tmp_path / "out"
    write_folder(out, results("1", "changed.csv", "old_1.csv", "old_2.csv"))
    if not as_one:
        (out / "sub").mkdir()
    (out / "changed.csv").write_text("mine")
    (out / "old_2.csv").write_text("mine")
    (out / "old_3.csv").write_text("mine")
    (out / "own.csv").write_text("mine")
    (out / "same.csv").write_text("2")
    (tmp_path / "far.csv").write_text("far")
    (out / "link.csv").symlink_to(tmp_path / "far.csv")
    names = ("changed.csv", "own.csv", "same.csv", "link.csv")
    with pytest.warns(UserWarning, match="kept as") as said:
        write_folder(out, results("2", *names), stale=("old_*.csv",))
    end = "changed.csv was not written by hovercontrol, or has changed since: kept as changed.kept-1.csv"
    assert len(said) == 3 and str(said[0].message).endswith(end)
    mine = {f"{name}.kept-1.csv": "mine" for name in ("changed", "own")}
    old = {"old_2.csv": "mine", "old_3.csv": "mine"}
    assert content(out) == {**dict.fromkeys(names, "2"), **mine, **old, "link.kept-1.csv": "far"}
    assert (tmp_path / "far.csv").read_text() == "far" and (out / "link.kept-1.csv").is_symlink()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_folder(out, results("3", *names))  # now they are its own
    assert content(out) == {**dict.fromkeys(names, "3"), **mine, **old, "link.kept-1.csv": "far"}


def test_a_list_that_is_a_link_counts_for_nothing(tmp_path):
    write_folder(tmp_path / "a", results("1", "old.csv"))
    (tmp_path / "b").mkdir()
    (tmp_path / "b" / LIST).symlink_to(tmp_path / "a" / LIST)
    (tmp_path / "b" / "old.csv").write_text("1")
    write_folder(tmp_path / "b", results("2", "new.csv"), stale=("old.csv",))
    assert content(tmp_path / "b") == {"old.csv": "1", "new.csv": "2"}


def test_names_of_unfinished_files_that_are_links_are_left_alone(tmp_path):
    """In a shared folder somebody else may choose the names that a killed run would have left."""
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "a.txt").write_text("thesis")
    dead = files.temporary_prefix().replace(f"-{os.getpid()}-", "-4194305-")  # no process has that number
    (tmp_path / "out").mkdir()
    link = tmp_path / "out" / f"{dead.replace('writing', 'placing')}x"
    link.symlink_to(tmp_path / "mine")
    write_atomically(tmp_path / "out" / "b.txt", lambda path: path.write_text("1"))
    assert link.is_symlink() and (tmp_path / "mine" / "a.txt").read_text() == "thesis"
    assert not (tmp_path / "out" / "a.txt").exists()


def test_a_failure_leaves_no_empty_folder(tmp_path):
    def fail(place):
        raise OSError(28, "No space left on device")

    for write in (write_atomically, write_folder):
        with pytest.raises(InputError, match="No space left"):
            write(tmp_path / "new" / "deep" / "a", fail)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_in_the_place_of_a_file_is_refused_before_anything_is_moved(tmp_path):
    (tmp_path / "out" / "b.csv").mkdir(parents=True)
    with pytest.raises(InputError, match=r"b\.csv: cannot be written: a folder has that name"):
        write_folder(tmp_path / "out", results("1"))
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["b.csv"]


KILLED = """
import os, signal, sys
from pathlib import Path
from hovercontrol.base import folders

steps, place, calls = int(sys.argv[1]), sys.argv[2], 0

def count(event, _):
    global calls, steps
    calls += event in ("os.rename", "os.link", "os.remove", "os.rmdir", "os.chmod", "ctypes.call_function")
    if calls > steps:
        steps = sys.maxsize  # to end it is an event, too
        os.kill(os.getpid(), signal.SIGKILL)

def write(folder):
    for k in range(3):
        (folder / f"{k}.csv").write_text("2")
    sys.addaudithook(count)

folders.write_folder(place, write)
"""  # fmt: skip


@pytest.mark.slow("True")
@pytest.mark.parametrize("as_one", [True, False])
def test_a_killed_run_leaves_old_or_new_and_the_next_clears_up(tmp_path, as_one):
    """Killed after every single change of names that it makes."""
    old, new = ({f"{k}.csv": text for k in range(3)} for text in "12")
    seen = set()
    for steps in range(40):
        out = tmp_path / str(steps) / "out"
        write_folder(out, results("1", *old))
        if not as_one:
            (out / "sub").mkdir()
        done = subprocess.run([sys.executable, "-c", KILLED, str(steps), str(out)], timeout=20)
        found = content(out)
        if as_one:
            assert found in (old, new), steps
        else:
            assert all(found[name] in "12" for name in old), steps
        seen.add("".join(found[name] for name in sorted(old)))
        write_folder(out, lambda folder: (folder / "last.txt").write_text("3"))
        after = content(out)
        assert after in ({**old, "last.txt": "3"}, {**new, "last.txt": "3"}), (steps, after)
        assert [p.name for p in out.parent.iterdir()] == ["out"]
        if done.returncode == 0:
            break
    assert done.returncode == 0 and {"111", "222"} <= seen


def test_a_running_neighbour_is_left_alone(tmp_path):
    theirs = tmp_path / files.temporary_prefix().replace(str(os.getpid()), "1")
    theirs.mkdir()
    write_atomically(tmp_path / "a.txt", lambda path: path.write_text("1"))
    assert theirs.exists()


def test_a_full_disk_is_one_line_and_leaves_what_was_there(tmp_path):
    write_folder(tmp_path / "out", results("1"))
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(InputError, match="out: cannot be written: File too large"):
            write_folder(tmp_path / "out", results("2" * 2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert content(tmp_path / "out") == {"a.csv": "1", "b.csv": "1"}
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


# ---- paths ---------------------------------------------------------------------------------------------


@pytest.fixture
def circle(tmp_path):
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    return tmp_path / "a"


def test_impossible_paths_are_one_line(circle, tmp_path):
    for path in (circle, "x" * 300, "a\0b", circle / "c", 3):
        for call in (readable, check_folder):
            with pytest.raises(InputError) as error:
                call(path)
            assert "\n" not in str(error.value) and len(str(error.value)) < 400
    for path in (circle / "c", tmp_path / ("x" * 300), "a\0b"):
        for write in (write_atomically, write_folder):
            with pytest.raises(InputError, match="cannot be written"):
                write(path, lambda place: None)
