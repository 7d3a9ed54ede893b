"""Rebuilding the documents: verdicts come from numbers, names are found, the index says what was measured."""

import json

import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.documents import Item, Outcome, Printed, all_items, find_items, rebuild
from hovercontrol.documents.index import index_content

FITTED = Printed("e", "0.6 m", 0.57, 0.63, fitted="by a factor")


def _item(*printed, measure=lambda folder: {}, **more):
    return Item("c17", "table", "2", "a table", measure, printed, **more)


@pytest.mark.parametrize(
    ("printed", "value", "verdict"),
    [
        ([Printed("e", "0.6 m", 0.57, 0.63)], 0.57, "agrees"),
        ([Printed("e", "0.6 m", 0.57, 0.63)], 0.5699, "differs"),
        ([Printed("e", "0.05", high=0.05)], 0.05, "agrees"),
        ([Printed("e", "0.05", high=0.05)], float("nan"), "differs"),
        ([FITTED], 0.6, "not printed in enough detail"),
        ([FITTED], 0.7, "differs"),
        ([FITTED, Printed("e", "1", high=1.0)], 0.6, "agrees"),
        ([], 1.0, "not printed in enough detail"),
    ],
)
def test_the_verdict_is_that_of_the_numbers(printed, value, verdict):
    assert Outcome(_item(*printed), {"e": value}).verdict == verdict


def test_what_fails_is_told_and_the_others_are_rebuilt(tmp_path):
    def draw(folder):
        (folder / "e.csv").write_text("1")
        return {"e": 0.2}

    def fail(folder):
        raise ValueError("no sample")

    other = Item("c17", "fig", "3", "a figure", draw, (Printed("e", "0.1 m", high=0.1),), why="<drag>")
    missing = Item("c17", "fig", "4", "another", draw, (Printed("f", "0.1", high=0.1),))
    outcomes = rebuild([_item(measure=fail), other, missing], tmp_path)
    assert [o.verdict for o in outcomes] == ["failed", "differs", "failed"]
    content = json.loads((tmp_path / "index.json").read_text())
    assert content == index_content(outcomes)
    first, second, third = content["items"]
    assert first["failure"] == "ValueError: no sample" and "'f' was not measured" in third["failure"]
    assert second["printed"][0]["ours"] == 0.2 and second["files"] == ["c17_fig_3/e.csv"]
    page = (tmp_path / "index.html").read_text()
    assert "&lt;drag&gt;" in page and "1 differs" in page and "2 failed" in page
    assert "Hovercraft Control With Dynamic Parameters Identification" in page and 'name="viewport"' in page
    assert "hovercontrol analyze &quot;c17 fig 3&quot;" in page
    assert (tmp_path / "c17_fig_3" / "e.csv").read_text() == "1"


@pytest.mark.parametrize("name", ["table 1", "table1", "Table  1", "c17 table 1"])
def test_an_item_is_found_under_the_names_that_one_would_type(name):
    assert [i.name for i in find_items("c17", name)] == ["table 1"]


def test_unknown_names_are_refused_with_the_nearest():
    assert find_items("c17", "figure 5x") == []
    with pytest.raises(InputError, match="unknown document 'c18'; did you mean 'c17'"):
        all_items("c18")
    with pytest.raises(InputError, match="nothing to rebuild"):
        rebuild([], "nowhere")


def test_each_item_has_one_entry_and_a_folder_of_its_own():
    items = all_items()
    assert len({i.folder for i in items}) == len(items)
    assert all(len({p.name for p in i.printed}) == len(i.printed) for i in items)


def test_the_command_lists_and_rebuilds(call, tmp_path):
    done = call("analyze", "--list", "--document", "c17")
    listed = done.stdout.splitlines()
    assert done.returncode == 0 and any(line.startswith("c17 table 1 ") for line in listed)
    assert any("c17_beta_region" in line and "analysis: " in line for line in listed)
    assert not any(line.startswith("k06") for line in listed)
    done = call("analyze", "c17 figure 5x")
    assert done.returncode == 2 and done.stderr.count("\n") == 1
    done = call("analyze", "eq 19", "--out", str(tmp_path))
    assert done.returncode == 0 and "1 not printed in enough detail" in done.stdout
    assert {"index.html", "index.json", "c17_eq_19"} <= {path.name for path in tmp_path.iterdir()}
