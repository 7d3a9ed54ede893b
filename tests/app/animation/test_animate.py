"""Animations as files: how many frames, how long each, what the page holds and that browsers play it."""

import asyncio
import json
import re
import stat
import sys
from itertools import pairwise

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from PIL import Image, ImageSequence

import hovercontrol as hc
from hovercontrol.app.animation import animate, plot_path
from hovercontrol.logs import Log
from tests.browser import CHROMIUM, browser

T = np.linspace(0.0, 2.0, 41)
LOG = Log(
    "a <b>turn</b>", T,
    {"x": np.sin(T), "y": 1 - np.cos(T), "psi": T, "u": np.ones(41), "thrust": 1 + T, "rudder": 0.2 * T,
     "x_ref": np.sin(T), "y_ref": 1.1 - np.cos(T)},
)  # fmt: skip

#: A program that takes ffmpeg's arguments and input, and writes what it was given.
FFMPEG = """#!{python}
import json, sys
frames = sys.stdin.buffer.read()
json.dump({{"words": sys.argv[1:-1], "bytes": len(frames)}}, open(sys.argv[-1], "w"))
sys.exit({status})
"""


def page_data(text):
    return json.loads(re.search(r"const run = (\{.*\});\n", text)[1])


@pytest.fixture
def ffmpeg(tmp_path, monkeypatch):
    def make(status=0):
        program = tmp_path / "ffmpeg"
        program.write_text(FFMPEG.format(python=sys.executable, status=status))
        program.chmod(program.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setitem(mpl.rcParams, "animation.ffmpeg_path", str(program))

    return make


@pytest.mark.parametrize(("speed", "fps", "frames"), [(1.0, 25.0, 51), (4.0, 25.0, 14), (0.5, 10.0, 41)])
def test_there_are_as_many_frames_as_real_time_asks_for(speed, fps, frames):
    assert animate(LOG, speed=speed, fps=fps).frames == frames


def test_the_page_holds_the_motion(tmp_path):
    animate(LOG, tmp_path / "turn.html")
    text = (tmp_path / "turn.html").read_text()
    found = page_data(text)
    at = found["step"] * np.arange(len(found["x"]))
    assert at[-1] == pytest.approx(2.0)
    np.testing.assert_allclose(found["x"], np.sin(at), atol=1e-3)
    np.testing.assert_allclose(found["psi"], at, atol=1e-4)
    (arrow,) = found["arrows"]
    held = 0.2 * np.floor(at / 0.05 + 1e-9) * 0.05
    np.testing.assert_allclose(np.arctan2(arrow["across"], arrow["along"]), held, atol=1e-3)
    assert found["target"][1][0] == pytest.approx(0.1) and found["line"] == found["target"]
    assert "&lt;b&gt;" in text and "<b>" not in text and "http" not in text


def test_a_notebook_shows_a_frame_that_reaches_nothing_outside():
    shown = animate(LOG)._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and 'sandbox="allow-scripts"' in shown
    assert "<script>" not in shown and "&lt;script&gt;" in shown


def test_a_gif_plays_as_long_as_the_run(tmp_path):
    animate(LOG, tmp_path / "turn.gif", fps=8.0, speed=4.0)
    with Image.open(tmp_path / "turn.gif") as found:
        frames = [frame.convert("RGB") for frame in ImageSequence.Iterator(found)]
        assert found.info["duration"] == 120 and found.info["loop"] == 0  # 1/8 s to hundredths
    assert len(frames) == 6  # 2 s at 4 x 0.12 s from frame to frame
    assert all(np.any(np.asarray(a) != np.asarray(b)) for a, b in pairwise(frames))


def test_ffmpeg_gets_every_frame_at_the_right_rate(tmp_path, ffmpeg):
    ffmpeg()
    parts = []
    animate(LOG, tmp_path / "turn.mp4", fps=5.0, speed=5.0, progress=parts.append)
    told = json.loads((tmp_path / "turn.mp4").read_text())
    assert told["bytes"] == 3 * 700 * 600 * 4 and parts == pytest.approx([1 / 3, 2 / 3, 1.0])
    words = dict(zip(told["words"], told["words"][1:], strict=False))
    assert float(words["-framerate"]) == 5.0 and words["-pix_fmt"] in {"rgba", "yuv420p"}


def test_nothing_is_left_of_a_movie_that_fails(tmp_path, ffmpeg):
    ffmpeg(status=1)
    (tmp_path / "turn.mp4").write_text("older")
    with pytest.raises(hc.InputError, match="ffmpeg ended with an error"):
        animate(LOG, tmp_path / "turn.mp4", fps=1.0)
    assert (tmp_path / "turn.mp4").read_text() == "older"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["ffmpeg", "turn.mp4"]


def test_without_ffmpeg_the_line_says_what_else_there_is(tmp_path, monkeypatch):
    monkeypatch.setitem(mpl.rcParams, "animation.ffmpeg_path", str(tmp_path / "none"))
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(hc.InputError, match=r"turn\.mp4: an MP4 needs ffmpeg.*\.html or \.gif"):
        animate(LOG, tmp_path / "turn.mp4")


@pytest.mark.parametrize(
    ("how", "said"),
    [
        ({"path": "turn.mp5"}, r"expected a file \.html, \.mp4, \.gif, found \.mp5; did you mean '\.mp4'"),
        ({"path": "turn"}, "found no suffix"),
        ({"speed": 0.0}, "speed must be positive"),
        ({"fps": -1.0}, "fps must be positive"),
        ({"speed": 1e-4}, "500001 frames are too many.*raise speed to 1 or more"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(how, said):
    with pytest.raises(hc.InputError, match=said):
        animate(LOG, **how)


def test_a_path_is_a_map_in_metres():
    figure = plot_path(LOG)
    assert plt.gcf() is figure
    (axes,) = figure.axes
    assert (axes.get_xlabel(), axes.get_ylabel(), axes.get_aspect()) == ("x [m]", "y [m]", 1.0)
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_array_equal(lines["centre of mass"].get_xdata(), np.sin(T))
    np.testing.assert_array_equal(lines["reference"].get_ydata(), 1.1 - np.cos(T))
    hulls = [patch.get_xy() for patch in axes.patches]
    assert len(hulls) == 9
    bow = hulls[4][0] - [np.sin(1.0), 1 - np.cos(1.0)]  # at 1 s the heading is 1 rad
    assert np.arctan2(bow[1], bow[0]) == pytest.approx(1.0)


def test_a_path_is_drawn_into_axes_that_are_given():
    own = plt.figure().subplots()
    assert plot_path(LOG, axes=own) is own.figure


def test_a_goal_is_a_mark_and_no_line():
    rows = {k: LOG[k] for k in ("x", "y", "psi")} | {
        "goal_x_ref": np.full(41, 2.0),
        "goal_y_ref": np.full(41, 3.0),
    }
    log = Log("goal", T, rows)
    lines = {line.get_label(): line for line in plot_path(log).axes[0].lines}
    assert lines["goal"].get_xydata().tolist() == [[2.0, 3.0]] and "reference" not in lines
    found = page_data(animate(log)._page())
    assert found["goal"] and found["line"] is None and found["target"][0][0] == 2.0


LATER = "new Promise(done => setTimeout(() => done([at, performance.now() / 1000]), {}))"


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_browser_plays_the_page_in_real_time(tmp_path):
    animate(LOG, tmp_path / "turn.html")

    async def play():
        async with browser() as page:
            await page.open((tmp_path / "turn.html").as_uri())
            await page.value("play.onclick()")
            begin, end = await page.value(LATER.format(300)), await page.value(LATER.format(700))
            await page.until("!playing")
            last = await page.value("[at, play.textContent, text.textContent]")
            assert not page.complaints
            return begin, end, last

    begin, end, (at, word, said) = asyncio.run(play())
    assert end[0] - begin[0] == pytest.approx(end[1] - begin[1], abs=0.15)
    assert at == pytest.approx(2.0) and word == "Play"
    assert "2.00 s" in said and "u +1.00 m/s" in said
