"""Damaged files of all formats end in rows up to the break, or in one line."""

from pathlib import Path

import pytest

from tests.logs.readers.damage import FILES, mutate, one_process


@pytest.mark.slow
@pytest.mark.parametrize("name", FILES)
def test_damage_ends_in_rows_or_in_one_line(tmp_path: Path, name: str, capfd) -> None:
    with one_process():
        outcomes = dict(mutate(name, tmp_path, range(10)))
    assert {k: what for k, what in outcomes.items() if what not in ("rows", "one line")} == {}
    assert capfd.readouterr() == ("", "")
