"""Small plots and sparklines as inline SVG. Colours come from the page's style, for light and dark mode."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from html import escape
from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.envelope import envelope
from hovercontrol.base.html import Markup

#: Maximum number of points of a line; more are not visible at the width of a plot.
MOST = 360

#: Maximum number of starts of a line that are marked.
RINGS = 12

#: Margins around the axes [px]: left (minimum), right, top, bottom.
LEFT, RIGHT, TOP, BOTTOM = 46.0, 8.0, 26.0, 22.0

#: Width of a character of tick labels and of a title [px], in the widest font that a page may use.
WIDE, WIDER = 7.0, 8.6

#: Size of a sparkline [px], and its maximum number of points.
SPARK_WIDTH, SPARK_HEIGHT, SPARK_POINTS = 160.0, 26.0, 240


class Plot:
    """A plot with one pair of axes.

    Parameters
    ----------
    x, y : (float, float)
        Ranges; widened a little if empty.
    title : str
        Shown above the axes, and read by screen readers.
    size : (float, float), optional
        Width and height in CSS pixels; a narrow column shrinks the plot.
    """

    def __init__(
        self,
        x: tuple[float, float],
        y: tuple[float, float],
        title: str,
        size: tuple[float, float] = (360.0, 150.0),
    ) -> None:
        self.x, self.y, self.title = _widened(x), _widened(y), title
        self.width, self.height = size
        self._up = labelled(*self.y, 4)
        self.left = max(LEFT, 8.0 + WIDE * max((len(text) for _, text in self._up), default=0))
        self._parts: list[str] = []

    def at(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return positions in pixels; values of `y` outside the axes are clipped near them."""
        (x0, x1), (y0, y1) = self.x, self.y
        w, h = self.width - self.left - RIGHT, self.height - TOP - BOTTOM
        across = self.left + w * (np.asarray(x, float) - x0) / (x1 - x0)
        up = TOP + h * (1.0 - np.clip((np.asarray(y, float) - y0) / (y1 - y0), -0.02, 1.02))
        return across, up

    def line(self, x: Array, y: Array, kind: str, starts: Sequence[int] = ()) -> None:
        """Draw a line, broken where `x` or `y` is not a number; long lines are thinned but keep extremes.

        Parameters
        ----------
        x, y : ndarray, shape (n,)
        kind : str
            Its class in the style: ``"measured"``, ``"before"``, ``"after"``.
        starts : sequence of int, optional
            Rows at which the line restarts without a connection; rings mark them if they are few.
        """
        fresh = []
        for part in _pieces(x + y, starts):
            rows = envelope(y[part], max(8, MOST * (part.stop - part.start) // y.size)) + part.start
            points = _points(*self.at(x[rows], y[rows]))
            self._parts.append(f'<path class="line {kind}" d="M{"L".join(points)}"/>')
            if 1 < len(starts) <= RINGS:
                fresh.append(points[0].split())
        self._parts += [f'<circle class="start {kind}" cx="{a}" cy="{b}" r="2"/>' for a, b in fresh]

    def band(self, x: Array, low: Array, high: Array, kind: str) -> None:
        """Fill between two lines, each of shape (n,)."""
        for part in _pieces(low + high):
            rows = np.unique(np.linspace(part.start, part.stop - 1, MOST).astype(int))
            there = _points(*self.at(x[rows], high[rows]))
            back = _points(*self.at(x[rows], low[rows]))[::-1]
            self._parts.append(f'<path class="fill {kind}" d="M{"L".join([*there, *back])}Z"/>')

    def dots(self, x: Array, y: Array, half: Array, kind: str) -> None:
        """Draw dots with error bars of `half` up and down, each of shape (n,)."""
        across, up = self.at(x, y)
        _, low = self.at(x, y - half)
        _, high = self.at(x, y + half)
        for a, b, c, d in zip(across, up, low, high, strict=True):
            if math.isfinite(b):
                self._parts.append(f'<path class="line {kind}" d="M{a:.1f} {c:.1f}V{d:.1f}"/>')
                self._parts.append(f'<circle class="{kind}" cx="{a:.1f}" cy="{b:.1f}" r="2.6"/>')

    def cells(self, x: Array, y: Array, side: float, share: Array, kind: str) -> None:
        """Fill squares of width `side`, in the units of the axes; a larger `share` (0 to 1) is darker.

        Parameters
        ----------
        x, y : ndarray, shape (n,)
            Lower left corners.
        share : ndarray, shape (n,)
        """
        left, low = self.at(x, y)
        right, high = self.at(x + side, y + side)
        shade = 0.06 + 0.94 * np.clip(share, 0.0, 1.0)
        for a, b, c, d, s in zip(left, low, right, high, shade, strict=True):
            box = f"M{a:.1f} {b:.1f}H{c:.1f}V{d:.1f}H{a:.1f}Z"
            self._parts.append(f'<path class="cell {kind}" fill-opacity="{s:.2f}" d="{box}"/>')

    def spans(self, spans: Iterable[tuple[float, float]], kind: str) -> None:
        """Mark intervals of x at the bottom of the axes."""
        foot = self.height - BOTTOM
        path = ""
        for a, b in spans:
            (left, right), _ = self.at(np.clip([a, b], *self.x), np.zeros(2))
            path += f"M{left:.1f} {foot:.1f}h{max(right - left, 1.0):.1f}v-4H{left:.1f}Z"
        if path:
            self._parts.append(f'<path class="mark {kind}" d="{path}"/>')

    def svg(self, unit: str = "", x_label: str = "[s]") -> str:
        """Return the SVG, with `unit` as label of the y axis and `x_label` at the end of the x axis."""
        w, h, left = self.width, self.height, self.left
        axes = [f'<path class="axis" d="M{left:g} {TOP:g}V{h - BOTTOM:g}H{w - RIGHT:g}"/>']
        for value, text in self._up:
            _, (up,) = self.at(np.zeros(1), np.array([value]))
            axes.append(f'<path class="grid" d="M{left:g} {up:.1f}H{w - RIGHT:g}"/>')
            axes.append(f'<text class="tick" x="{left - 5:g}" y="{up + 3.5:.1f}">{text}</text>')
        end = w - 6.0 - WIDE * len(x_label) if x_label else w
        for value, text in labelled(*self.x, 6, room=w - left - RIGHT):
            (across,), _ = self.at(np.array([value]), np.zeros(1))
            if across + 0.5 * WIDE * len(text) < end:
                axes.append(f'<text class="tick below" x="{across:.1f}" y="{h - 5:g}">{text}</text>')
        label = f'<text class="tick" x="{w - 2:g}" y="{h - 5:g}">{escape(x_label)}</text>'
        title, most = self.title, int((w - 16.0 - WIDE * len(unit)) / WIDER)
        title = title if len(title) <= most else f"{title[: most - 1]}…"
        heading = f'<text class="name" x="2" y="13">{escape(title)}</text>'
        unit_text = f'<text class="tick" x="{w - RIGHT:g}" y="13">{escape(unit)}</text>'
        return (
            f'<svg viewBox="0 0 {w:g} {h:g}" role="img" aria-label="{escape(self.title, quote=True)}">'
            + "".join(axes)
            + "".join(self._parts)
            + heading
            + unit_text
            + (label if x_label else "")
            + "</svg>"
        )


def sparkline(time: ArrayLike, values: ArrayLike, *, stairs: bool = False) -> Markup:
    """Return a signal over time as a small line without axes, with gaps where it is not a number.

    Parameters
    ----------
    time, values : array_like, shape (n,)
    stairs : bool, optional
        Whether the values hold from one time to the next.

    Examples
    --------
    >>> sparkline([0.0, 1.0], [0.0, 2.0]).count("<polyline"), sparkline([], [])
    (1, '')
    """
    t, y = np.asarray(time, dtype=float), np.asarray(values, dtype=float)
    known = np.isfinite(y)
    if not known.any():
        return Markup("")
    low, high, begin, end = float(y[known].min()), float(y[known].max()), float(t[0]), float(t[-1])
    across = (t - begin) / ((end - begin) or 1.0) * (SPARK_WIDTH - 2) + 1
    up = SPARK_HEIGHT - 2 - (y - low) / ((high - low) or 1.0) * (SPARK_HEIGHT - 4)
    if known.mean() < 0.9:  # rows of commands between those of measurements are no gaps
        across, up = across[known], up[known]
    lines = ""
    for part in _pieces(up):
        x, h = across[part], up[part]
        if stairs:
            x, h = np.repeat(x, 2)[1:], np.repeat(h, 2)[:-1]
        rows = envelope(h, SPARK_POINTS)
        lines += f"<polyline points='{','.join(_points(x[rows], h[rows]))}'/>"
    return Markup(
        f"<svg width='{SPARK_WIDTH:g}' height='{SPARK_HEIGHT:g}' "
        f"viewBox='0 0 {SPARK_WIDTH:g} {SPARK_HEIGHT:g}' role='img' "
        "style='vertical-align:middle' fill='none' stroke='currentColor' stroke-width='1'>"
        f"<title>{low:.4g} to {high:.4g}</title>{lines}</svg>"
    )


def ticks(low: float, high: float, most: int) -> list[float]:
    """Return round values within a range.

    Examples
    --------
    >>> ticks(0.0, 1.0, 4)
    [0.0, 0.5, 1.0]
    """
    return [value for value, _ in labelled(low, high, most)]


def labelled(low: float, high: float, most: int, room: float = math.inf) -> list[tuple[float, str]]:
    """Return the largest set of round values within a range that fits, each with a distinct label.

    Parameters
    ----------
    most : int
        Maximum number of steps.
    room : float, optional
        Width available for the labels side by side [px].

    Examples
    --------
    >>> labelled(1000.0, 1000.25, 4)
    [(1000.0, '1000.0'), (1000.1, '1000.1'), (1000.2, '1000.2')]
    """
    power = math.floor(math.log10((high - low) / most))
    found: list[tuple[float, str]] = []
    for digits, factor in product((power, power + 1), (1, 2, 5)):
        step = factor * 10.0**digits
        first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
        values = [round(k * step, max(0, -digits)) + 0.0 for k in range(first, last + 1)]
        found = list(zip(values, _numbers(values, digits), strict=True))
        widest = WIDE * max((len(text) for _, text in found), default=0) + 6.0
        if len(found) <= most + 1 and widest <= room * step / (high - low):
            break
    return found


def bounds(
    rows: Sequence[Array], *, around_zero: bool = False, part: float = 1.0, least: float = 0.0
) -> tuple[float, float]:
    """Return a range that contains rows of numbers, with a margin.

    Parameters
    ----------
    around_zero : bool, optional
        Whether the range is symmetric about zero.
    part : float, optional
        Fraction of the numbers that the range contains; the others are extremes.
    least : float, optional
        Minimum half-width, so that negligible values do not look large.
    """
    known = np.concatenate([row[np.isfinite(row)] for row in rows] or [np.zeros(1)])
    if not known.size:
        return -1.0, 1.0
    low, high = (float(v) for v in np.quantile(known, [0.5 - part / 2, 0.5 + part / 2]))
    if around_zero:
        high = max(abs(low), abs(high))
        low = -high
    if high - low < 2.0 * least:
        low, high = 0.5 * (low + high) - least, 0.5 * (low + high) + least
    room = 0.06 * (high - low)
    return low - room, high + room


def _numbers(values: Sequence[float], digits: int) -> list[str]:
    """Return labels of multiples of a power of ten, as short as they stay distinct."""
    plain = [f"{value:.{max(0, -digits)}f}" if value else "0" for value in values]
    if max((len(text.lstrip("-")) for text in plain), default=0) > 6:
        sizes = [math.floor(math.log10(abs(value)) + 1e-9) if value else digits for value in values]
        powers = [f"{v:.{max(0, s - digits)}e}" if v else "0" for v, s in zip(values, sizes, strict=True)]
        powers = [re.sub(r"e([+-])0*", lambda found: "e" + found[1].strip("+"), text) for text in powers]
        plain = min(plain, powers, key=lambda texts: max(map(len, texts)))
    return [text.replace("-", "−") for text in plain]


def _widened(span: tuple[float, float]) -> tuple[float, float]:
    low, high = span
    least = 1e-9 + 1e-6 * max(abs(low), abs(high))
    return (low, high) if high - low > least else (low - least, high + least)


def _pieces(y: Array, starts: Sequence[int] = ()) -> list[slice]:
    """Return the stretches of two or more finite rows, also cut at `starts`."""
    found = []
    for begin, end in pairwise(sorted({0, y.size, *starts})):
        known = np.concatenate([[0], np.isfinite(y[begin:end]).astype(int), [0]])
        edges = begin + np.flatnonzero(np.diff(known))
        found += [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a > 1]
    return found


def _points(across: Array, up: Array) -> list[str]:
    return [f"{a:.1f} {b:.1f}" for a, b in zip(across.tolist(), up.tolist(), strict=True)]
