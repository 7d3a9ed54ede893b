"""Pieces of what notebooks show: tables, folded parts, sparklines; colours follow the page, light or dark."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Points of a sparkline, at most; two for each of so many stretches: its lowest and its highest.
STRETCHES = 120

#: Size of a sparkline in CSS pixels.
WIDE, HIGH = 160.0, 26.0

#: Rows of a table that are shown; the rest is folded away.
ROWS = 14

_CELL = "padding:.15em .7em;text-align:left;vertical-align:top"


class Markup(str):
    """Text that is HTML already."""


def show(value: object) -> str:
    """Return a cell's HTML: numbers short, text escaped.

    Examples
    --------
    >>> show(0.12345678), show("a<b"), show(float("inf")), show(Markup("<b>x</b>"))
    ('0.1235', 'a&lt;b', 'inf', '<b>x</b>')
    """
    if isinstance(value, Markup):
        return value
    if isinstance(value, float | np.floating):
        return f"{float(value):.4g}"
    return escape("" if value is None else str(value))


def card(kind: str, name: str, remark: str, *parts: str) -> str:
    """Return a whole: what it is, its name, a line on it, and its parts."""
    line = f" <span style='opacity:.75'>{escape(remark)}</span>" if remark else ""
    head = f"<div style='margin:.3em 0'>{escape(kind)} <b>{escape(name)}</b>{line}</div>"
    return f"<div style='font-size:.95em;max-width:70em'>{head}{''.join(parts)}</div>"


def table(headings: Sequence[str], rows: Iterable[Sequence[object]], caption: str = "") -> str:
    """Return a table; empty without rows, its end folded away where it is long."""
    every = [
        "<tr>" + "".join(f"<td style='{_CELL}'>{show(cell)}</td>" for cell in row) + "</tr>" for row in rows
    ]
    if not every:
        return ""
    heads = "".join(f"<th style='{_CELL}'>{escape(h)}</th>" for h in headings)
    top = f"<table style='border-collapse:collapse'><thead><tr>{heads}</tr></thead><tbody>"
    text = f"{top}{''.join(every[:ROWS])}</tbody></table>"
    if len(every) > ROWS:
        text += fold(f"{len(every) - ROWS} more", f"{top}{''.join(every[ROWS:])}</tbody></table>")
    title = f"<div style='opacity:.75;margin-top:.5em'>{escape(caption)}</div>" if caption else ""
    return title + text


def fold(title: str, body: str, *, unfolded: bool = False) -> str:
    """Return a part that opens at a click; HTML does it alone."""
    flag = " open" if unfolded else ""
    return f"<details{flag}><summary style='cursor:pointer'>{escape(title)}</summary>{body}</details>"


def lines(*texts: str) -> str:
    """Return sentences, one below the other."""
    return "".join(f"<div>{escape(text)}</div>" for text in texts if text)


def sparkline(time: ArrayLike, values: ArrayLike, *, stairs: bool = False) -> Markup:
    """Return a signal over time as a small SVG; what is no number is a gap.

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
    low, high = float(y[known].min()), float(y[known].max())
    begin, end = float(t[0]), float(t[-1])
    across = (t - begin) / ((end - begin) or 1.0) * (WIDE - 2) + 1
    up = HIGH - 2 - (y - low) / ((high - low) or 1.0) * (HIGH - 4)
    pieces = []
    for x, h in _stretches(across, up, known):
        if stairs:
            x, h = np.repeat(x, 2)[1:], np.repeat(h, 2)[:-1]
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(*_thinned(x, h), strict=True))
        pieces.append(f"<polyline points='{points}'/>")
    text = f"{_short(low)} to {_short(high)}"
    return Markup(
        f"<svg width='{WIDE:g}' height='{HIGH:g}' viewBox='0 0 {WIDE:g} {HIGH:g}' role='img' "
        f"style='vertical-align:middle' fill='none' stroke='currentColor' stroke-width='1'>"
        f"<title>{text}</title>{''.join(pieces)}</svg>"
    )


def _stretches(
    x: NDArray[np.float64], y: NDArray[np.float64], known: NDArray[np.bool_]
) -> Iterable[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Yield the runs of finite samples; single missing ones in a log of two rates are no gap."""
    if known.mean() < 0.9 and known.sum() > 1:  # rows of commands between those of measurements
        yield x[known], y[known]
        return
    edges = np.flatnonzero(np.diff(np.concatenate([[0], known.astype(int), [0]]))).reshape(-1, 2)
    for a, b in edges:
        yield x[a:b], y[a:b]


def _thinned(
    x: NDArray[np.float64], y: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return as much of a line as can be seen: lowest and highest of each stretch."""
    if x.size <= 2 * STRETCHES:
        return x, y
    kept = {0, x.size - 1}
    for part in np.array_split(np.arange(x.size), STRETCHES):
        kept |= {int(part[y[part].argmin()]), int(part[y[part].argmax()])}
    rows = sorted(kept)
    return x[rows], y[rows]


def _short(value: float) -> str:
    return f"{value:.4g}" if math.isfinite(value) else str(value)
