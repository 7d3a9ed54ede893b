"""A file appears whole or not at all."""

import os

import pytest

from hovercontrol.files import write_whole


def test_the_file_and_its_folder_appear(tmp_path):
    path = write_whole(tmp_path / "new" / "model.toml", lambda p: p.write_text("[plant]\n"))
    assert path.read_text() == "[plant]\n"
    assert [p.name for p in path.parent.iterdir()] == ["model.toml"]


def test_a_failure_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "model.toml"
    path.write_text("old")

    def fail(temporary):
        temporary.write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_whole(path, fail)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["model.toml"]


def test_the_writer_sees_the_same_suffix(tmp_path):
    seen = []
    write_whole(tmp_path / "log.csv", lambda p: seen.append(p.suffix))
    assert seen == [".csv"]


def test_permissions_follow_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        path = write_whole(tmp_path / "model.toml", lambda p: p.write_text("x"))
    finally:
        os.umask(old)
    assert path.stat().st_mode & 0o777 == 0o640
