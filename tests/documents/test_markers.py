"""Every numbered item of the documents has its place in the code, or a reason for having none."""

import csv
from pathlib import Path

import pytest

from hovercontrol.documents import numbered_items, places
from hovercontrol.documents.item import KINDS
from hovercontrol.documents.markers import MARKER
from hovercontrol.documents.registry import DOCUMENTS, all_items

PLACES = places()
KNOWN = {item.key: item for document in DOCUMENTS for item in numbered_items(document)}


def test_a_marker_may_name_several_numbers():
    assert MARKER.findall("beta [C17 eq 18, 19] and [K06 table 6.7]; [C17 eq] is none") == [
        ("C17", "eq", "18, 19"),
        ("K06", "table", "6.7"),
    ]


def test_each_numbered_item_is_listed_once():
    for document in DOCUMENTS:
        items = numbered_items(document)
        assert len({i.key for i in items}) == len(items)
        assert {i.kind for i in items} <= set(KINDS)


def test_no_marker_names_what_the_documents_have_not():
    assert {key: str(found[0]) for key, found in PLACES.items() if key not in KNOWN} == {}


def test_what_is_rebuilt_is_numbered():
    assert [i.name for i in all_items() if (i.document, i.kind, i.number) not in KNOWN] == []


@pytest.mark.parametrize("key", [k for k in KNOWN if k[0] == "c17"], ids=" ".join)
def test_every_item_of_c17_has_a_place_or_a_reason(key):
    assert bool(PLACES.get(key)) != bool(KNOWN[key].without_code)


def test_every_table_and_figure_of_c17_is_rebuilt_or_has_a_reason():
    rebuilt = {(i.document, i.kind, i.number) for i in all_items("c17")}
    wanted = {
        k for k, n in KNOWN.items() if k[0] == "c17" and k[1] in ("table", "fig") and not n.without_code
    }
    assert wanted <= rebuilt


def test_a_place_is_where_the_marker_stands():
    place = PLACES["c17", "fig", "5"][0]
    root = Path(__file__).parents[2]
    line = (root / place.file).read_text().splitlines()[place.line - 1]
    assert MARKER.search(line)


def test_a_bound_lies_about_its_printed_value_and_a_row_without_number_has_none():
    import hovercontrol.documents

    for document in DOCUMENTS:
        path = Path(hovercontrol.documents.__file__).parent / document / "printed.csv"
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for row in rows:
            low, value, high = (float(row[key] or "nan") for key in ("low", "value", "high"))
            bounded = bool(row["value"] or (row["low"] and row["high"]))
            assert bool(row["name"]) == bounded == bool(row["text"]), row
            assert not (value < low or value > high), row
