"""The trace of a search: every named effect passed, and for every other one a row says why not."""

import json

import pytest

from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.report import write_report

KINDS = ["effect", "partial", "none", "ambiguous", "unexplained"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_candidate_has_a_score_in_the_trace(every, kind):
    found = every[kind].found
    scored = {row.effect for row in found.trace if row.step == "score"}
    assert scored >= {lead.name for lead in found.leads}
    assert len(scored) >= found.selection.candidates - len(found.selection.effects)


@pytest.mark.parametrize("kind", KINDS)
def test_a_named_effect_passed_its_last_tests(every, kind):
    found = every[kind].found
    for name in {e.effect for e in found.effects}:
        confirmed = [row for row in found.why(name) if row.step == "confirm"]
        gain = [row for row in confirmed if row.rule.startswith("gain")][-1]
        assert gain.passed and gain.value == pytest.approx(found.evidence[name].gain)
        assert gain.limit >= CRITERIA.least
        held = [row for row in found.why(name) if row.step == "hold out"]
        assert held and all(row.passed for row in held[-1:])


@pytest.mark.parametrize("kind", ["effect", "partial", "unexplained"])
def test_what_is_not_named_failed_somewhere_or_was_less_likely(every, kind):
    found = every[kind].found
    named = {e.effect for e in found.effects}
    for name in {row.effect for row in found.trace} - named:
        rows = found.why(name)
        assert any(not row.passed for row in rows) or any(row.step == "fit" for row in rows)


def test_numbers_agree_with_what_was_decided(every):
    for d in every.values():
        for row in d.found.trace:
            if row.rule.endswith("at least") and row.step == "confirm":
                assert row.passed == (row.value >= row.limit)
            if row.rule.endswith("at most"):
                assert row.passed == (row.value <= row.limit)


def test_the_trace_is_written_and_shown(every, tmp_path):
    found = every["unexplained"].found
    found.save(tmp_path)
    written = json.loads((tmp_path / "result.json").read_text())["trace"]
    assert len(written) == len(found.trace) > 0
    assert {row["step"] for row in written} <= {"score", "fit", "confirm", "challenge", "hold out"}
    page = write_report(found, tmp_path / "report.html").read_text()
    failed = next(row for row in found.trace if not row.passed)
    assert "Every decision" in page and failed.rule in page
    assert found.why("no_such_effect") == []
