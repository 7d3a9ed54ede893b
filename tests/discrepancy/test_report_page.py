"""The report as its readers see it, in a browser: on a screen and on a phone, light and dark."""

import asyncio
import re
from dataclasses import replace

import numpy as np
import pytest

from hovercontrol.discrepancy.report import pictures, write_report
from hovercontrol.discrepancy.report.equations import equations
from hovercontrol.discrepancy.report.html import grid
from hovercontrol.discrepancy.report.material import Material
from hovercontrol.discrepancy.report.page import page as html
from hovercontrol.discrepancy.report.svg import Plot, labelled
from hovercontrol.discrepancy.traces import Trace
from hovercontrol.effects import effect
from hovercontrol.model import Model

from ..browser import CHROMIUM, browser

browsed = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")

WIDE = "document.scrollingElement.scrollWidth - innerWidth"
UNFOLD = "document.querySelectorAll('details').forEach(d => d.open = true)"
NEW = """[...document.querySelectorAll('math .new, math .new *')].map(e => e.getBoundingClientRect())
  .filter(r => r.width > 0).map(r => [r.left, r.right])"""
TABLES = """[...document.querySelectorAll('body > .scroll')]
  .map(e => [e.scrollWidth - e.clientWidth, e.querySelector('th').textContent])"""

#: Labels that leave their picture, or of one picture lie over each other.
LABELS = """[...document.querySelectorAll('svg')].flatMap(svg => {
  const box = svg.getBoundingClientRect(), found = []
  const texts = [...svg.querySelectorAll('text')].map(t => [t.textContent, t.getBoundingClientRect()])
  texts.forEach(([a, r], i) => {
    if (r.left < box.left - .5 || r.right > box.right + .5 || r.top < box.top - .5
        || r.bottom > box.bottom + .5)
      found.push(svg.ariaLabel + ': ' + a + ' outside')
    texts.slice(i + 1).forEach(([b, s]) => {
      if (Math.min(r.right, s.right) - Math.max(r.left, s.left) > .5
          && Math.min(r.bottom, s.bottom) - Math.max(r.top, s.top) > .5)
        found.push(svg.ariaLabel + ': ' + a + ' over ' + b)
    })
  })
  return found
})"""

#: Colours of every text, with the background it stands on, and of lines.
COLOURS = """[...document.querySelectorAll('body *')].flatMap(e => {
  const own = [...e.childNodes].some(n => n.nodeType === 3 && n.data.trim()) && e.getClientRects().length
  const line = e.matches('svg .line')
  if (!own && !line) return []
  let behind = e
  while (behind && /^rgba\\(0, 0, 0, 0\\)$|^transparent$/.test(getComputedStyle(behind).backgroundColor))
    behind = behind.parentElement
  const style = getComputedStyle(e), drawn = line ? style.stroke : e.closest('svg') ? style.fill : style.color
  return [[line, drawn, getComputedStyle(behind || document.body).backgroundColor, e.tagName]]
})"""


def contrast(one, other):
    """Return the contrast of two colours (Web Content Accessibility Guidelines 2, 1.4.3)."""

    def luminance(colour):
        parts = np.array([float(v) for v in re.findall(r"[\d.]+", colour)[:3]]) / 255
        return np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ (
            0.2126,
            0.7152,
            0.0722,
        )

    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def looked_at(path, look, **how):
    async def open_it():
        async with browser() as page:
            await page.open(path.as_uri(), **how)
            await page.value(UNFOLD)
            await look(page)
            assert page.complaints == []
            assert page.fetched == [path.as_uri()]

    asyncio.run(open_it())


async def marked_terms_are_seen(page):
    places = await page.value(NEW)
    assert len(places) > 8
    assert min(left for left, _ in places) >= 0 and max(right for _, right in places) <= 390


@pytest.fixture(scope="session")
def report(sloping, tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    return write_report(sloping.found, sloping.case.holdout, folder / "report.html", names=["slope", "wind"])


@pytest.fixture(scope="session")
def unexplained(sloping, tmp_path_factory):
    bare = replace(sloping.found.selection, final=sloping.found.selection.base, effects=[], gains={})
    found = replace(
        sloping.found, verdict="unexplained", effects=(), amended=sloping.found.refitted, selection=bare
    )
    path = tmp_path_factory.mktemp("page") / "report.html"
    return write_report(found, sloping.case.holdout, path, names=["slope"], warnings=["a" * 90])


@browsed
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("verdict", ["report", "unexplained"])
def test_a_page_can_be_read_at_any_width_and_in_any_light(request, verdict, dark):
    async def look(page):
        for width in (1280, 700, 390, 320):
            await page.size(width, 844)
            assert await page.value(WIDE) <= 0, width
            assert await page.value(LABELS) == [], width
        colours = await page.value(COLOURS)
        assert {len(c) for c in colours} == {4} and len(colours) > 100
        faint = [c for c in colours if contrast(c[1], c[2]) < (2.0 if c[0] else 4.5)]
        assert faint == []
        page_colour = await page.value("getComputedStyle(document.body).backgroundColor")
        assert (contrast(page_colour, "rgb(0, 0, 0)") < 2) == dark

    looked_at(request.getfixturevalue(verdict), look, dark=dark)


@browsed
def test_on_a_phone_nothing_that_matters_is_cut(report):
    async def look(page):
        await marked_terms_are_seen(page)
        tables = await page.value(TABLES)
        assert {"channel", "coefficient", "effect"} <= {name for _, name in tables}
        assert [name for cut, name in tables if cut > 0] == []

    looked_at(report, look, width=390, height=844)


@browsed
def test_a_new_term_wider_than_a_phone_is_seen_whole(sloping, tmp_path):
    model = sloping.found.refitted
    windy = Model("craft", [*model.effects, effect("wind", x=0.3, y=0.1)])
    found = replace(sloping.found, amended=windy, effects=())
    section = equations(Material(found, False, None, None, (), None, 1.0, (), ""))
    assert "wind_x" in section
    path = tmp_path / "equations.html"
    path.write_text(html("equations", [section]), encoding="utf-8")
    looked_at(path, marked_terms_are_seen, width=390, height=844)


@browsed
def test_labels_of_any_numbers_stand_apart_and_inside(tmp_path):
    ranges = [(1.7e9, 1.7e9 + 12), (-3e-7, 2e-7), (-1e-4, 1e-4), (-123456.0, 98765.0), (99.98, 100.03)]
    plots = [Plot(x, y, "error of the starboard wheel's speed over ground") for x in ranges for y in ranges]
    path = tmp_path / "plots.html"
    path.write_text(html("plots", [grid(plot.svg("rad/s²", "m/s") for plot in plots)]), encoding="utf-8")

    async def look(page):
        assert await page.value("document.querySelectorAll('svg text').length") > 25 * 6
        assert await page.value(LABELS) == []

    looked_at(path, look, width=390, height=844)


@pytest.mark.parametrize("low, high", [(1.7e9, 1.7e9 + 12), (-3e-7, 2e-7), (-40.0, 30.0), (0.9998, 1.0003)])
def test_labels_say_their_number_and_no_two_say_the_same(low, high):
    found = labelled(low, high, 4)
    assert 2 <= len(found) <= 5 and len({text for _, text in found}) == len(found)
    for value, text in found:
        assert float(text.replace("−", "-")) == pytest.approx(value, abs=1e-6 * (high - low))


def saw(starts, seconds=40.0, every=1):
    """Return a craft that stands still beside a simulation that runs away at 1 m/s from each start."""
    time = np.arange(0.0, seconds, 0.05)
    since = time - np.array(starts)[np.searchsorted(starts, time, side="right") - 1]
    simulated = np.array([since, -since, since])
    measured = np.zeros_like(simulated)
    for rows in (measured, simulated):
        rows[:, np.arange(time.size) % every > 0] = np.nan
    units = {"x": "m", "y": "m", "psi": "rad"}
    return Trace("log", time, ("x", "y", "psi"), units, measured, simulated, tuple(starts))


def strokes(picture, kind="before"):
    """Return the points of each line of a kind."""
    return [
        np.array([[float(v) for v in point.split()] for point in path.split("L")])
        for path in re.findall(rf'class="line {kind}" d="M(.*?)"', picture)
    ]


@pytest.mark.parametrize("every", [1, 3, 15])
def test_no_line_leads_from_one_simulation_to_the_next(every):
    trace = saw([0.0, 10.0, 20.0, 30.0], every=every)
    still = dict.fromkeys(trace.channels, 0.1)
    drawn = {
        "over time": (pictures.overlays(trace, trace, False)[0], 2, 0),
        "errors": (pictures.errors(trace, trace, still, False)[0], 4, 0),
        "way": (pictures.path(trace, trace, False), 2, 1),
    }
    for name, (picture, count, upwards) in drawn.items():
        lines = strokes(picture)
        assert len(lines) == count, name
        for line in lines:  # away from the measurement all the time, and never back
            assert (np.diff(line[:, 1]) * (1 if upwards else -1) > -0.11).all(), name
        assert picture.count('class="start before"') == count, name
    assert strokes(drawn["over time"][0], "measured")


def test_many_starts_are_not_marked():
    trace = saw(np.arange(0.0, 40.0, 1.0).tolist())
    picture = pictures.errors(trace, trace, dict.fromkeys(trace.channels, 0.1), False)[0]
    assert len(strokes(picture)) == 40 and "start" not in picture


def test_the_legend_says_when_simulations_start_afresh(report):
    text = report.read_text(encoding="utf-8")
    assert "They start afresh about every 10 s: there the line breaks." in text
    assert '<span class="start">start of a simulation</span>' in text
