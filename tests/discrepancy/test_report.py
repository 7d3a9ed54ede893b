"""The report: one page that says the verdict with its number, and needs nothing from elsewhere."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from hovercontrol.discrepancy import diagnose
from hovercontrol.discrepancy.data import gather
from hovercontrol.discrepancy.fit import fit
from hovercontrol.discrepancy.probes import Sign
from hovercontrol.discrepancy.report import headline, write_report
from hovercontrol.discrepancy.report.svg import Plot, bounds, ticks
from hovercontrol.discrepancy.report.verdict import explanation, gap_sentence
from hovercontrol.discrepancy.report.words import meaning
from hovercontrol.discrepancy.selection import Rival
from hovercontrol.effects import effect_names
from hovercontrol.logs import Log

from .generator import Conditions, make

SIGN = Sign("oscillation", "v' answers like a load that swings at 0.5 Hz", 120.0, 2)
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
    return page, " ".join(" ".join(page.text).split())


def variants(found):
    bare = replace(found.selection, final=found.selection.base, effects=[], gains={})
    none = replace(found, verdict="none", effects=(), amended=found.refitted, selection=bare)
    rival = Rival("wind", "slope", 3.2, 0.93, found.amended)
    return {
        "effect": found,
        "none": none,
        "ambiguous": replace(found, verdict="ambiguous", rivals=(rival,)),
        "unexplained": replace(none, verdict="unexplained", signs=(SIGN,)),
    }


@pytest.fixture(scope="session")
def pages(sloping, tmp_path_factory):
    folder = tmp_path_factory.mktemp("pages")
    return {
        name: write_report(
            d,
            sloping.case.holdout,
            folder / f"{name}.html",
            names=["slope", "wind"],
            warnings=["log 1: <doubtful>"],
            command="hovercontrol diagnose a.csv",
        )
        for name, d in variants(sloping.found).items()
    }


@pytest.mark.parametrize("verdict", ["effect", "none", "ambiguous", "unexplained"])
def test_a_page_is_whole_small_and_fetches_nothing(pages, verdict):
    page, text = read(pages[verdict])
    assert page.fetched == [] and "script" not in page.tags
    content = pages[verdict].read_text(encoding="utf-8")
    assert "url(" not in content and "@import" not in content
    assert pages[verdict].stat().st_size < 1_000_000
    assert not re.search(r"\bnan\b|\binf\b|None", text)
    assert "log 1: <doubtful>" in text and "hovercontrol diagnose a.csv" in text
    assert "prefers-color-scheme: dark" in content and "width=device-width" in content


def test_the_first_heading_is_the_verdict_with_number_interval_and_unit(pages, sloping):
    truth = sloping.case.truth.effect("slope").values["x"]
    content = pages["effect"].read_text(encoding="utf-8")
    heading = re.search(r"<h1>(.*?)</h1>", content)[1].replace("\u00a0", " ")
    assert heading.startswith("The model has no slope: slope_x ") and "m/s²" in heading
    value, half = re.search(r"slope_x (\S+) ± (\S+) m/s²", heading).groups()
    assert float(value.replace("−", "-")) == pytest.approx(truth, abs=2.5 * float(half))


def test_the_gap_of_the_worst_channel_is_told(sloping):
    d = sloping.found
    said = re.search(r"the error of (\w+) falls from (\S+) to (\S+) times its noise", gap_sentence(d))
    channel, before, after = said.groups()
    assert float(before) == pytest.approx(d.before.nrmse[channel] / d.before.floor[channel], rel=0.01)
    assert float(after) == pytest.approx(d.after.nrmse[channel] / d.after.floor[channel], rel=0.01)
    assert float(before) > 1.5 > float(after)


def test_without_a_hold_out_log_that_is_said(sloping):
    d = replace(sloping.found, before=None, after=None)
    assert gap_sentence(d).startswith("On the training logs (none was held out)")


def test_new_terms_are_marked_and_old_ones_are_not(pages):
    content = pages["effect"].read_text(encoding="utf-8")
    marked = re.findall(r"<mrow class='new'>(.*?)</mrow>(?=<mo|</mrow></math>)", content)
    assert len(marked) == 4 and all("slope_" in term for term in marked)
    assert "class='new'" not in pages["none"].read_text(encoding="utf-8").partition("</style>")[2]


@pytest.mark.parametrize("name", effect_names())
def test_effects_explain_themselves_without_marks_of_a_docstring(name):
    said = meaning(name)
    assert said.endswith(".") and "`" not in said


def test_rivals_are_named_with_their_correlation(pages):
    _, text = read(pages["ambiguous"])
    assert re.search(r"these logs cannot tell what: slope \(slope_x .*?\) or wind\.", text)
    assert re.search(r"wind slope 5 times 0\.930", text)  # e^(3.2 / 2)
    assert (
        "7.4 times charged for each number that one has more than the other; 400 times would tell" in text
        and "errs as little" not in text
    )
    assert "error on the hold-out log" not in text  # not measured: nothing is said of it


def test_rivals_are_shown_with_their_error_on_the_hold_out_log(sloping, tmp_path):
    d = variants(sloping.found)["ambiguous"]
    d = replace(d, rival_gaps={"wind": d.before})
    _, text = read(write_report(d, sloping.case.holdout, tmp_path / "r.html", names=["slope"]))
    ours, rival = (f"{np.sqrt(g.chi2 / g.count):.2f}" for g in (d.after, d.before))
    assert f"slope (named) {ours} wind slope 5 times 0.930 {rival}" in text.replace("\u2014 ", "")


def test_the_error_of_a_rival_is_that_of_its_model():
    case = make(11009, ["wind"], Conditions(duration=10.0, logs=1))
    found = diagnose(case.model, case.logs, case.holdout, names=["wind", "slope"])
    assert found.verdict == "ambiguous" and [*found.rival_gaps] == [r.name for r in found.rivals]
    rival, held = found.rivals[0], gather(case.model, [case.holdout])
    again = fit(rival.model, held, 1.0, frozen=True)
    for k, channel in enumerate(held.channels):
        left = again.residual[..., k][again.windowed.seen[..., k]]
        assert found.rival_gaps[rival.name].rms[channel] == pytest.approx(np.sqrt(np.mean(left**2)))


def test_random_forces_are_not_called_noise(sloping, tmp_path):
    d = sloping.found
    final = d.selection.final
    gusty = replace(final, noise=final.noise.but(process=np.array([0, 0, 0, 1e-3, 1e-3, 1e-3])))
    selection = replace(d.selection, base=gusty, final=gusty, process=True, effects=[], gains={})
    text = "these logs take random forces of 2.8 rad/s^2 in r' to explain"
    veto = "body_side_force would fit the training logs, but the hold-out log is predicted worse with it"
    signs = (Sign("process", text, 818455592.0, 1), Sign("hold-out", veto, 1e8, 1), SIGN)
    d = replace(d, verdict="unexplained", effects=(), refitted=d.amended, selection=selection, signs=signs)
    _, text = read(write_report(d, sloping.case.holdout, tmp_path / "r.html", names=["slope"]))
    assert "What remains is noise" not in text and "count as noise: beyond them nothing is left" in text
    assert "random forces of 2.8 rad/s² in r′" in text and "Body side force would fit" in text
    assert "818455592" not in text and "1 numbers" not in text and "evidence 120, where chance" in text


def test_coefficients_that_hide_what_is_missing_are_shown(sloping, pages, tmp_path):
    _, text = read(pages["none"])
    assert "without" not in text.partition("Coefficients")[2].partition("widths")[0].replace(
        "without int", ""
    )
    d, name = sloping.found, "yaw_linear_drag"
    given = d.model.coefficients()[name]
    d = replace(d, refitted=d.refitted.with_coefficients({name: 3.0 * given}))
    _, text = read(write_report(d, sloping.case.holdout, tmp_path / "r.html", names=["slope"]))
    table = text.partition("Coefficients")[2].replace("_ ", "_")  # long names may break
    assert f"{name} ends at {3 * given:.2g}, given {given:.2g}" in table and "without slope found" in table
    assert re.search(rf"{name} {given:.4g} {3 * given:.4g} \S+ ± ", table)


def test_what_is_unexplained_gets_no_name(pages):
    _, text = read(pages["unexplained"])
    assert "in a way that no effect of the catalogue explains" in text
    assert "v′ answers like a load that swings at 0.5 Hz" in text
    assert not re.search(r"\bslope|\bwind\b|±", text)


def test_none_says_what_would_have_shown(pages):
    _, text = read(pages["none"])
    assert "No disagreement beyond noise." in text and "would show from" in text
    assert "the amended model" not in text


def test_with_gusts_none_does_not_say_that_nothing_is_missing(sloping):
    d = sloping.found
    final = d.selection.final
    gusty = replace(final, noise=final.noise.but(process=np.array([0, 0, 0, 0.05, 0.05, 0.2])))
    selection = replace(d.selection, final=gusty, process=True)
    d = replace(d, verdict="none", effects=(), selection=selection)
    assert headline(d) == "No effect can be named above the disturbances in these logs."
    said = " ".join(explanation(d))
    assert "0.05 m/s² in u′" in said and "0.2 rad/s² in r′" in said and "may still be missing" in said


def test_without_a_hold_out_log_a_training_log_is_shown(sloping, tmp_path):
    d = replace(sloping.found, before=None, after=None)
    _, text = read(write_report(d, None, tmp_path / "r.html", names=["slope"]))
    assert "Log log 1, one of the training logs" in text and "Made by a script" in text


def test_two_logs_of_one_name_are_kept_apart(tmp_path):
    case = make(11, ["slope"], Conditions(duration=12.0))
    logs = [Log("log.csv", log.time, log.columns) for log in (case.logs[0], case.logs[1].between(1.0, 12.0))]
    found = diagnose(case.model, logs, names=["slope"])
    _, text = read(write_report(found, None, tmp_path / "r.html", names=["slope"]))
    assert text.count("Over time, in log.csv") == 1


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
