"""Small plots as inline SVG: colours come from the page's style, so that they follow light and dark."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Points of a line at most; more cannot be seen at the width of a plot.
MOST = 360

#: Room around the axes: left, right, top, bottom.
LEFT, RIGHT, TOP, BOTTOM = 46.0, 8.0, 22.0, 20.0


class Plot:
    """One pair of axes.

    Parameters
    ----------
    x, y : (float, float)
        Ranges; widened a little if empty.
    title : str
        Said above the axes, and to those who cannot see the picture.
    size : (float, float), optional
        Width and height in CSS pixels; the width is the most, a narrow column shrinks it.
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
        self._parts: list[str] = []

    def at(self, x: Array, y: Array) -> tuple[Array, Array]:
        """Return places in pixels; values far outside the axes are kept near them."""
        (x0, x1), (y0, y1) = self.x, self.y
        w, h = self.width - LEFT - RIGHT, self.height - TOP - BOTTOM
        across = LEFT + w * (np.asarray(x, float) - x0) / (x1 - x0)
        up = TOP + h * (1.0 - np.clip((np.asarray(y, float) - y0) / (y1 - y0), -0.02, 1.02))
        return across, up

    def line(self, x: Array, y: Array, kind: str) -> None:
        """Draw a line, broken where `y` is no number; long ones keep their extremes.

        Parameters
        ----------
        x, y : ndarray, shape (n,)
        kind : str
            Its class in the style: ``"measured"``, ``"before"``, ``"after"``, ``"floor"``.
        """
        for part in _pieces(y):
            rows = _thinned(y[part]) + part.start
            path = "M" + "L".join(_points(*self.at(x[rows], y[rows])))
            self._parts.append(f'<path class="line {kind}" d="{path}"/>')

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

    def spans(self, spans: Iterable[tuple[float, float]], kind: str) -> None:
        """Mark stretches of the x axis at the foot of the axes."""
        foot = self.height - BOTTOM
        path = ""
        for a, b in spans:
            (left, right), _ = self.at(np.clip([a, b], *self.x), np.zeros(2))
            path += f"M{left:.1f} {foot:.1f}h{max(right - left, 1.0):.1f}v-4H{left:.1f}Z"
        if path:
            self._parts.append(f'<path class="mark {kind}" d="{path}"/>')

    def svg(self, unit: str = "", x_label: str = "s") -> str:
        """Return the picture; `unit` stands at the y axis, `x_label` at the end of the x axis."""
        w, h = self.width, self.height
        axes = [f'<path class="axis" d="M{LEFT:g} {TOP:g}V{h - BOTTOM:g}H{w - RIGHT:g}"/>']
        for value in ticks(*self.y, 4):
            _, (up,) = self.at(np.zeros(1), np.array([value]))
            axes.append(f'<path class="grid" d="M{LEFT:g} {up:.1f}H{w - RIGHT:g}"/>')
            axes.append(f'<text class="tick" x="{LEFT - 5:g}" y="{up + 3.5:.1f}">{_number(value)}</text>')
        room = 12.0 + 6.0 * len(x_label) if x_label else 0.0
        for value in ticks(*self.x, 6):
            (across,), _ = self.at(np.array([value]), np.zeros(1))
            if across > w - room:
                continue
            axes.append(f'<text class="tick below" x="{across:.1f}" y="{h - 6:g}">{_number(value)}</text>')
        label = f'<text class="tick" x="{w - 2:g}" y="{h - 6:g}">{escape(x_label)}</text>'
        heading = f'<text class="name" x="2" y="13">{escape(self.title)}</text>'
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


def ticks(low: float, high: float, most: int) -> list[float]:
    """Return round values within a range.

    Examples
    --------
    >>> ticks(0.0, 1.0, 4)
    [0.0, 0.5, 1.0]
    """
    raw = (high - low) / most
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(s * power for s in (1.0, 2.0, 5.0, 10.0) if s * power >= raw * (1 - 1e-9))
    first = math.ceil(low / step - 1e-9)
    return [round(k * step, 12) + 0.0 for k in range(first, math.floor(high / step + 1e-9) + 1)]


def bounds(
    rows: Sequence[Array], *, around_zero: bool = False, part: float = 1.0, least: float = 0.0
) -> tuple[float, float]:
    """Return a range that holds rows of numbers with some room.

    Parameters
    ----------
    rows : sequence of ndarray
    around_zero : bool, optional
        Whether zero is in the middle.
    part : float, optional
        How much of the numbers it holds; the rest are extremes.
    least : float, optional
        Half its width at least, lest nothing look like something.
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


def _number(value: float) -> str:
    return f"{value:.4g}".replace("-", "−").replace("e−0", "e−").replace("e+0", "e")


def _widened(span: tuple[float, float]) -> tuple[float, float]:
    low, high = span
    least = 1e-9 + 1e-6 * max(abs(low), abs(high))
    return (low, high) if high - low > least else (low - least, high + least)


def _pieces(y: Array) -> list[slice]:
    """Return the stretches of two or more rows that are numbers."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.isfinite(y).astype(int), [0]])))
    return [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2) if b - a > 1]


def _thinned(y: Array) -> NDArray[np.intp]:
    """Return rows that keep a line's look: of each stretch its ends and extremes."""
    n = y.size
    if n <= MOST:
        return np.arange(n)
    edges = np.linspace(0, n, MOST // 2 + 1).astype(int)
    found = {0, n - 1}
    for a, b in pairwise(edges.tolist()):
        if b > a:
            found |= {int(a + y[a:b].argmin()), int(a + y[a:b].argmax())}
    return np.array(sorted(found), dtype=np.intp)


def _points(across: Array, up: Array) -> list[str]:
    return [f"{a:.1f} {b:.1f}" for a, b in zip(across.tolist(), up.tolist(), strict=True)]
