"""The report as its readers see it, in a browser: on a screen and on a phone, light and dark."""

import asyncio
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from hovercontrol.base.svg import Plot, labelled
from hovercontrol.craft.effects import effect
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.diagnose.report import pictures, write_report
from hovercontrol.identification.diagnose.report.context import Context
from hovercontrol.identification.diagnose.report.equations import equations
from hovercontrol.identification.diagnose.report.free_run import FreeRun
from hovercontrol.identification.diagnose.report.page import page as html
from hovercontrol.identification.diagnose.report.templates import figures
from tests.browser import CHROMIUM, browser

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
def report(gusty, tmp_path_factory):
    return write_report(gusty.found, tmp_path_factory.mktemp("page") / "report.html")


@pytest.fixture(scope="session")
def unexplained(patched, tmp_path_factory):
    found = replace(patched.found, warnings=("a" * 90,))
    return write_report(found, tmp_path_factory.mktemp("page") / "report.html")


@pytest.mark.slow
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


@pytest.mark.slow
@browsed
def test_on_a_phone_nothing_that_matters_is_cut(report):
    async def look(page):
        await marked_terms_are_seen(page)
        tables = await page.value(TABLES)
        assert {"number", "equation", "coefficient"} <= {name for _, name in tables}
        assert [name for cut, name in tables if cut > 0] == []

    looked_at(report, look, width=390, height=844)


@browsed
def test_on_paper_a_page_is_light_and_nothing_stays_folded(report):
    async def look(page):
        await page.call("Emulation.setEmulatedMedia", media="print")
        await page.value("document.querySelectorAll('details').forEach(d => d.open = false)")
        assert contrast(await page.value("getComputedStyle(document.body).color"), "rgb(255, 255, 255)") > 10
        shown = await page.value(
            "[...document.querySelectorAll('details > :not(summary)')].map(e => e.checkVisibility("
            "{contentVisibilityAuto: true}) && e.getBoundingClientRect().height > 0)"
        )
        assert shown and all(shown)

    looked_at(report, look, dark=True)


@browsed
def test_a_new_term_wider_than_a_phone_is_seen_whole(sloping, tmp_path):
    model = sloping.found.refitted
    added = [effect("wind", x=0.3, y=0.1), effect("slope", x=0.1)]
    windy = Model("craft", [*model.effects, *added])
    section = equations(Context(replace(sloping.found, amended=windy), None, None, False, ()))
    assert "wind_x" in section
    path = tmp_path / "equations.html"
    path.write_text(html("equations", [section]), encoding="utf-8")
    looked_at(path, marked_terms_are_seen, width=390, height=844)


@browsed
def test_labels_of_any_numbers_stand_apart_and_inside(tmp_path):
    ranges = [(1.7e9, 1.7e9 + 12), (-3e-7, 2e-7), (-1e-4, 1e-4), (-123456.0, 98765.0), (99.98, 100.03)]
    plots = [Plot(x, y, "error of the starboard wheel's speed over ground") for x in ranges for y in ranges]
    path = tmp_path / "plots.html"
    path.write_text(html("plots", [figures(plot.svg("rad/s²", "m/s") for plot in plots)]), encoding="utf-8")

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


def saw(every=1, seconds=40.0, run=10.0):
    """Return a craft that stands still beside runs that leave it at 1 m/s, each for some seconds."""
    time = np.arange(0.0, seconds, 0.05)
    measured = np.zeros((3, time.size))
    measured[:, np.arange(time.size) % every > 0] = np.nan
    at = np.concatenate([np.linspace(begin, begin + run, 201) for begin in np.arange(0.0, seconds, run)])
    since = np.tile(np.linspace(0.0, run, 201), round(seconds / run))
    units = {"x": "m", "y": "m", "psi": "rad"}
    starts = tuple(range(0, at.size, 201))
    return FreeRun(
        "log", ("x", "y", "psi"), units, time, measured, at, np.array([since, -since, since]), starts
    )


def strokes(picture, kind="before"):
    """Return the points of each line of a kind."""
    return [
        np.array([[float(v) for v in point.split()] for point in path.split("L")])
        for path in re.findall(rf'class="line {kind}" d="M(.*?)"', picture)
    ]


@pytest.mark.parametrize("every", [1, 3, 15])
def test_no_line_leads_from_one_run_to_the_next(every):
    run = saw(every)
    assert not run.keeps_near()
    picture = pictures.overlays(run, run, False)[0]
    lines = strokes(picture)
    assert len(lines) >= 2 and picture.count('class="start before"') == len(lines)
    for line in lines:  # away from the measurement all the time, and never back
        assert (np.diff(line[:, 1]) < 0.11).all()
    assert strokes(picture, "measured")


def test_many_starts_are_not_marked():
    run = saw(run=1.0)
    picture = pictures.overlays(run, run, False)[0]
    assert len(strokes(picture)) > 12 and 'class="start' not in picture


def test_the_legend_says_when_runs_start_afresh(report):
    text = report.read_text(encoding="utf-8")
    assert re.search(r"about every \d+ s a new run starts: there the line breaks", text)
    assert '<span class="start">start of a run</span>' in text


def test_a_map_of_the_floor_is_darkest_where_the_force_is():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-1.0, 1.0, (2, 4000))
    picture = pictures.floor_map("force", x, y, np.where(x > 0.5, 1.0, 0.1), "m/s²", "after")
    cells = re.findall(r'fill-opacity="(\S+)" d="M(\S+) ', picture)
    shades = np.array(cells, dtype=float)
    right = shades[:, 1] > np.quantile(shades[:, 1], 0.85)
    assert shades[right, 0].min() > 0.9 and np.median(shades[~right, 0]) < 0.2
    assert "0 <span" in picture and "m/s²" in picture
    assert pictures.floor_map("force", x[:5], y[:5], x[:5], "m/s²", "after") == ""


def test_bars_of_one_model_are_multiples_of_the_noise():
    far = [
        SimpleNamespace(channel=c, before=b, after=b, unit="m", horizon=1.0)
        for c, b in (("x", 0.4), ("y", 0.1))
    ]
    drawn = pictures.error_bars(far, False, {"x": 0.1, "y": 0.05})
    assert re.findall(r"--long:(\S+)\"", drawn) == ["1.000", "0.500"]
    assert "<b>4.00</b>" in drawn and "after" not in drawn
