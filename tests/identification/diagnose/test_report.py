"""The report: one page that says what is missing and what remains, and needs nothing from elsewhere."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from hovercontrol.base.svg import Plot, bounds, ticks
from hovercontrol.craft.effects import effect_class, effect_names
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.diagnose.criteria import CRITERIA
from hovercontrol.identification.diagnose.evidence.holdout import Ahead, Gained
from hovercontrol.identification.diagnose.report import (
    gap_sentence,
    headline,
    remainder_sentence,
    write_report,
)
from hovercontrol.identification.diagnose.report.formatting import meaning
from hovercontrol.identification.diagnose.report.free_run import free_run
from hovercontrol.identification.diagnose.report.pictures import horizons
from hovercontrol.identification.diagnose.search.leads import ASKED_FOR, Lead
from hovercontrol.logs import Log

from .generator import Conditions, make

KINDS = ("effect", "partial", "none", "ambiguous", "two readings", "unexplained")
VOID = {"meta", "br", "path", "circle"}


class Page(HTMLParser):
    """Checks that tags close, collects text and what a browser would fetch."""

    def __init__(self):
        super().__init__()
        self.open, self.text, self.fetched, self.tags = [], [], [], []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.fetched += [v for k, v in attrs if k in ("src", "href", "srcset", "data")]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] != "style":
            self.text.append(data)


def read(path):
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    assert page.open == []
    return page, " ".join(" ".join(page.text).replace("\u00a0", " ").split())


@pytest.fixture(scope="session")
def pages(every, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    return {
        kind: write_report(
            replace(d.found, warnings=("log 1: <doubtful>",)),
            folder / f"{kind.replace(' ', '_')}.html",
            command="hovercontrol diagnose a.csv",
        )
        for kind, d in every.items()
    }


@pytest.mark.parametrize("kind", KINDS)
def test_a_page_is_whole_small_and_fetches_nothing(every, pages, kind):
    page, text = read(pages[kind])
    assert page.fetched == [] and "script" not in page.tags
    content = pages[kind].read_text(encoding="utf-8")
    assert "url(" not in content and "@import" not in content
    assert pages[kind].stat().st_size < 1_000_000
    assert not re.search(r"\bnan\b|\binf\b|None", text)
    assert "log 1: <doubtful>" in text and "hovercontrol diagnose a.csv" in text
    assert "prefers-color-scheme: dark" in content and "width=device-width" in content
    found = every[kind].found
    for sentence in (headline(found), gap_sentence(found), remainder_sentence(found)):
        assert sentence in text
    assert found.verdict == ("effect" if kind == "two readings" else kind)


@pytest.mark.parametrize("kind", KINDS)
def test_every_result_has_evidence_remainder_and_leads(every, kind):
    d = every[kind].found
    result = json.loads(json.dumps(d.result()))
    assert {*result["remainder"]} == {"u'", "v'", "r'"}
    for left in result["remainder"].values():
        assert {"rms", "unit", "share_explained"} <= {*left} and left["rms"] >= 0
        assert (left["where"] is None) == (left["rms"] == 0.0)
        for begin, end in (left["where"] or {"segments": []})["segments"]:
            assert 0.0 <= begin <= end
    remains = any(left["rms"] > 0 for left in result["remainder"].values())
    assert remains == (kind in ("partial", "unexplained"))
    assert bool(result["effects"]) == (kind not in ("none", "unexplained"))
    for e in result["effects"]:
        told = e["evidence"]
        assert told["gain"] > 0 and {"n", "same_sign", "t"} <= {*told["blocks"]}
        assert {*told["holdout"][0]} == {"horizon", "channel", "before", "after", "unit", "t"}
    assert all({"name", "gain", "blocks_t", "reason"} == {*lead} for lead in result["leads"])
    assert {"before", "after", "floor"} <= {*result["gap"]["holdout"]} and "train" in result["gap"]
    assert {"verdict", "rivals", "where", "next_experiment", "rows_dropped"} <= {*result}


def test_an_effect_is_told_with_number_standard_error_and_unit(sloping):
    truth = sloping.case.truth.effect("slope").values["x"]
    value, std = re.match(r"Missing: slope, x (\S+) ± (\S+) m/s² and y", headline(sloping.found)).groups()
    assert float(value) == pytest.approx(truth, abs=4 * float(std))
    assert remainder_sentence(sloping.found) == "Unmodelled residual: none beyond noise."


def test_what_it_takes_of_the_held_out_error_is_told_in_units(sloping):
    d = sloping.found
    said = re.fullmatch(
        r"On the held-out log it removes (\S+) % of the error of (\w+) (\S+) s ahead "
        r"\((\S+) to (\S+) \S+\)\.",
        gap_sentence(d),
    )
    part, channel, horizon, before, after = said.groups()
    (told,) = [a for a in d.ahead if a.channel == channel and a.horizon == pytest.approx(float(horizon))]
    assert float(before) == pytest.approx(told.before, rel=0.1)
    assert float(after) == pytest.approx(told.after, rel=0.1)
    assert float(part) == pytest.approx(100 * (1 - told.after / told.before), abs=1)


def test_a_remainder_is_told_beside_the_name(gusty, pages):
    d = gusty.found
    assert d.verdict == "partial" and headline(d).startswith("Missing: slope, x ")
    said = remainder_sentence(d)
    for r in d.remainders:
        assert r.rms > 0 and f"in {r.equation[0]}′" in said
    assert "(averaged over 0.2 s); it is largest in" in said
    _, text = read(pages["partial"])
    assert "explained" in text.partition("Unmodelled residual Root")[2]


def test_a_page_says_where_what_is_missing_acts_over_signals_place_and_time(pages):
    _, text = read(pages["effect"])
    where = text.partition("Where the model lacks something")[2].partition("What was added")[0]
    assert "slope u′, v′ everywhere" in where and "of the rows; in log 1" in where
    for equation in ("u′", "v′"):  # a slope's force turns with the heading
        assert f"In {equation}" in where
    assert where.count("over psi") == 2 and "by position" in where and "Over time, in log" in where


def test_an_effect_of_no_catalogue_is_told_with_how_to_have_it_named(patched):
    heavy = Lead("mass_drift", 900.0, 50.0, ASKED_FOR)
    said = headline(replace(patched.found, leads=(heavy, Lead("battery_sag", 220.0, 18.0, "gains 12 of 24"))))
    assert said == (
        "Missing: a residual that no candidate effect explains; nearest come mass drift (named where it is "
        "asked for: --effects mass_drift) and battery sag (gains 12 of 24)."
    )


def test_two_readings_of_one_finding_are_no_doubt(late):
    said = headline(late.found)
    assert late.found.verdict == "effect"
    assert re.fullmatch(
        r"Missing: input delay, \S+ ± \S+ s \(or time offset: both have the same effect on every log\)\.",
        said,
    )


def test_a_rival_that_is_likelier_is_said_to_be(windy, tmp_path):
    (rival,) = windy.found.rivals
    d = replace(windy.found, rivals=(replace(rival, behind=-4.0),))
    _, text = read(write_report(d, tmp_path / "r.html"))
    assert "it is 7.4 times likelier" in text


def test_what_cannot_be_told_apart_is_named_together(windy, pages):
    assert windy.found.verdict == "ambiguous"
    assert headline(windy.found).endswith("or else slope: these logs do not distinguish them.")
    assert "Not distinguished by these logs" in read(pages["ambiguous"])[1]


def test_what_is_unexplained_has_leads_and_no_name(patched, pages):
    d = patched.found
    assert d.verdict == "unexplained" and d.leads
    weak, strong = (replace(d, leads=(replace(d.leads[0], gain=k * CRITERIA.least),)) for k in (0.5, 2.0))
    assert headline(weak) == "Missing: a residual that no candidate effect explains."
    assert f"explains; nearest comes cubic drag in surge ({d.leads[0].reason})." in headline(strong)
    _, text = read(pages["unexplained"])
    assert "They are hints, not findings." in text and d.leads[0].reason in text
    assert "the amended model" not in text.replace("the amended model still needs", "")


def test_errors_that_rise_are_told_beside_the_likelihood_that_does_too(sloping):
    d = sloping.found
    risen = tuple(replace(a, before=a.after, after=2.5 * a.after, t=-4.0) for a in d.ahead)
    worst = max(risen, key=lambda a: a.after / a.before)
    likelier = {"slope": replace(d.evidence["slope"], gained=Gained(253.0, 60.0))}
    said = gap_sentence(replace(d, ahead=risen, evidence=likelier))
    assert (
        said.startswith("On the held-out log the error of ")
        and f"{worst.horizon:g} s ahead rises from" in said
    )
    assert said.endswith(", though the log is likelier (twice its log likelihood gains 253).")
    level = tuple(replace(a, t=0.0) for a in d.ahead)
    assert gap_sentence(replace(d, ahead=level)).endswith("no channel is predicted significantly better.")


def test_nothing_missing_is_said_so(complete, pages):
    assert headline(complete.found) == "Missing: nothing beyond noise."
    assert remainder_sentence(complete.found) == "Unmodelled residual: none beyond noise."
    assert "Evidence" not in read(pages["none"])[1]


def test_without_a_held_out_log_that_is_said(sloping, tmp_path):
    d = replace(sloping.found, before=None, after=None, held_before=None, held_after=None, ahead=())
    assert gap_sentence(d).startswith("No log was held out; on the training logs it removes ")
    _, text = read(write_report(d, tmp_path / "r.html"))
    assert "Log log 1, one of the training logs" in text and "Made by a script" in text


def test_new_terms_are_marked_and_old_ones_are_not(pages):
    content = pages["effect"].read_text(encoding="utf-8")
    marked = re.findall(r"<mrow class='new'>(.*?)</mrow>(?=<mo|</mrow></math>)", content)
    assert len(marked) == 4 and all("slope_" in term for term in marked)
    assert "class='new'" not in pages["none"].read_text(encoding="utf-8").partition("</style>")[2]


@pytest.mark.parametrize("name", effect_names())
def test_effects_explain_themselves_without_marks_of_a_docstring(name):
    said = meaning(effect_class(name))
    assert said.endswith(".") and "`" not in said


def test_coefficients_that_hide_what_is_missing_are_shown(sloping, pages, tmp_path):
    assert "without slope" not in read(pages["effect"])[1]
    d, name = sloping.found, "yaw_linear_drag"
    given = d.model.coefficients()[name]
    d = replace(d, refitted=d.refitted.with_coefficients({name: 3.0 * given}))
    _, text = read(write_report(d, tmp_path / "r.html"))
    table = text.partition("Coefficients")[2].replace("_ ", "_")  # long names may break
    assert f"{name} ends at {3 * given:.2g}, given {given:.2g}" in table and "without slope found" in table
    assert re.search(rf"{name} {given:.4g} {3 * given:.4g} \S+ ± ", table)


def test_blocks_that_tell_nothing_are_left_out_of_the_picture(sloping, pages):
    content = pages["effect"].read_text(encoding="utf-8")
    picture = re.search(r'aria-label="slope, relative to the size on all logs">(.*?)</svg>', content)[1]
    assert picture.count('<circle class="log0"') == sloping.found.evidence["slope"].blocks.n


@pytest.mark.slow
def test_two_logs_of_one_name_are_kept_apart(tmp_path):
    case = make(11, ["slope"], Conditions(duration=12.0))
    logs = [Log("log.csv", log.time, log.columns) for log in (case.logs[0], case.logs[1].between(1.0, 12.0))]
    found = diagnose(case.model, logs, names=["slope"])
    _, text = read(write_report(found, tmp_path / "r.html"))
    assert text.count("Over time, in log.csv") == 1


@pytest.mark.parametrize("seconds", [2.0, 5.0, 100.0])
def test_free_runs_follow_the_log_and_start_on_its_path(sloping, seconds):
    run = free_run(sloping.found.held_after, 0, seconds)
    begins = run.at[list(run.starts)]
    assert begins.size == max(1, round(20.0 / seconds)) and begins[0] == run.time[0]
    assert np.diff(begins) == pytest.approx(seconds, abs=0.05)
    for measured, simulated in zip(run.measured, run.simulated, strict=True):
        at_rows = np.interp(begins, run.time, measured) - simulated[list(run.starts)]
        assert np.abs(at_rows).max() < 0.05
    if seconds < 10:
        assert run.keeps_near()


def test_an_error_of_a_prediction_that_diverges_is_drawn_at_the_upper_end():
    far = [Ahead(h, "T", "K", before, 2.0, 0.0) for h, before in ((0.2, 3.0), (0.5, np.inf))]
    (picture,) = horizons(far, True, {"T": 0.1})
    assert "nan" not in picture and "inf" not in picture and picture.count("<circle") == 4


def test_ticks_are_round_and_inside():
    for low, high in ((0.0, 1.0), (-3.3, 7.9), (1e-7, 3e-7), (990.0, 1010.0)):
        found = ticks(low, high, 4)
        assert 2 <= len(found) <= 5 and low - 1e-12 <= min(found) and max(found) <= high + 1e-12


def test_a_plot_keeps_extremes_of_long_lines_and_breaks_at_holes():
    y = np.zeros(100_000)
    y[61_234], y[500:600] = 5.0, np.nan
    plot = Plot((0.0, 1.0), bounds([y]), "spike")
    plot.line(np.linspace(0, 1, y.size), y, "before")
    picture = plot.svg()
    heights = [
        float(p.split()[1]) for path in re.findall(r'before" d="M(.*?)"', picture) for p in path.split("L")
    ]
    assert min(heights) < 40 < 100 < max(heights)
    assert picture.count('class="line before"') == 2 and len(picture) < 20_000
