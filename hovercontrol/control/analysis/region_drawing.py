"""How a map over two parameters is drawn: areas that say in words what holds in them."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from itertools import cycle, product
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from scipy.ndimage import distance_transform_edt

from hovercontrol.base.arrays import Array, Mask
from hovercontrol.base.errors import InputError
from hovercontrol.base.figure_style import BLACK, BLUE, COLOUR_MAP, GREEN, PURPLE, SKY, VERMILION

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from hovercontrol.control.analysis.regions import Region


#: How areas look: the first is filled, the second hatched, the others are outlines.
LOOKS: tuple[dict[str, Any], ...] = (
    {"facecolor": SKY, "alpha": 0.35, "hatch": None, "linestyle": "-", "edgecolor": BLUE},
    {"facecolor": "none", "hatch": "///", "linestyle": "-", "edgecolor": VERMILION},
    {"facecolor": "none", "hatch": None, "linestyle": "--", "edgecolor": GREEN},
    {"facecolor": "none", "hatch": None, "linestyle": ":", "edgecolor": PURPLE},
    {"facecolor": "none", "hatch": None, "linestyle": "-.", "edgecolor": BLACK},
)

#: So many of the areas are filled or hatched; each combination of them has its words in the picture.
WRITTEN = 2

#: A part of the map smaller than this share, or thinner than this share of the height, has no words.
SMALLEST, THINNEST = 0.03, 0.045

#: A quantity with fewer points along an axis has no contour lines.
FINE = 30

#: Signs in a line of words.
WIDTH = 24

#: How words look: black on a white rim, so that hatching does not hide them.
HALO: dict[str, Any] = {
    "fontsize": 8,
    "zorder": 5,
    "path_effects": [withStroke(linewidth=3, foreground="white")],
}


def draw_region(region: Region, names: Iterable[str], axes: Axes) -> None:
    """Draw maps of a region: areas with what holds in them in words, quantities in colours.

    Parameters
    ----------
    region : Region
    names : iterable of str
        The maps to draw.
    axes : matplotlib.axes.Axes

    Raises
    ------
    InputError
        If there is no such map, or it is a line: both axes need two points.
    """
    shown = {name: region[name] for name in names}
    points = len(region.x.values), len(region.y.values)
    if min(points) < 2:
        raise InputError(f"a map of {points[0]} x {points[1]} points cannot be drawn, 2 x 2 are needed")
    areas = [name for name, values in shown.items() if values.dtype == bool]
    for name, values in shown.items():
        if values.dtype != bool:
            _shade(region, axes, name, values)
    plain = len(areas) == len(shown)
    looks = dict(zip(areas, cycle(LOOKS if plain else LOOKS[2:]), strict=False))
    handles: list[Any] = []
    for name, look in looks.items():
        _area(region, axes, shown[name], look)
        handles.append(Patch(label=region.label(name), **look))
    for (name, (x, y)), style in zip(region.lines.items(), cycle(("-", "--", "-.", ":"))):
        axes.plot(x, y, color=BLACK, lw=2.0, ls=style)
        handles.append(Line2D([], [], color=BLACK, lw=2.0, ls=style, label=name))
    for (name, point), marker in zip(region.marks.items(), cycle("osD^")):
        (drawn,) = axes.plot(*point, marker, color=BLACK, mfc="white", ms=8, ls="none", label=name, zorder=4)
        handles.append(drawn)
    axes.set(xlabel=str(region.x), ylabel=str(region.y))
    if _are_places(region):
        axes.set_aspect("equal")
    if areas:
        axes.set_xlim(*region.x.values[[0, -1]])
        axes.set_ylim(*region.y.values[[0, -1]])
    if plain:
        _write(region, axes, areas[:WRITTEN])
    if handles:
        place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.14)}
        axes.legend(handles=handles, frameon=False, fontsize="small", **place)


def _are_places(region: Region) -> bool:
    """Return whether the axes are those of a place in metres: ``x`` and ``y``, ``goal_x`` and ``goal_y``."""
    x, y = region.x, region.y
    return x.unit == y.unit == "m" and x.name[-1:] == "x" and y.name == f"{x.name[:-1]}y"


def _area(region: Region, axes: Axes, values: Mask, look: Mapping[str, Any]) -> None:
    if not values.any():
        return
    grid = (region.x.values, region.y.values, values.astype(float))
    alpha = look.get("alpha")
    filled = axes.contourf(
        *grid, [0.5, 1.5], colors=[look["facecolor"]], hatches=[look["hatch"]], alpha=alpha
    )
    filled.set_edgecolor(look["edgecolor"])
    filled.set_linewidth(0.0)
    axes.contour(*grid, [0.5], colors=look["edgecolor"], linestyles=look["linestyle"], linewidths=1.6)


def _shade(region: Region, axes: Axes, name: str, values: Array) -> None:
    finite = np.where(np.isfinite(values), values, np.nan)
    grid = (region.x.values, region.y.values, finite)
    drawn = axes.pcolormesh(*grid, cmap=COLOUR_MAP, shading="nearest", rasterized=True)
    if min(values.shape) >= FINE and np.nanmax(finite) > np.nanmin(finite):
        lines = axes.contour(*grid, 7, colors="white", linewidths=0.6)
        axes.clabel(lines, fontsize=7)
    figure = axes.get_figure(root=True)
    assert isinstance(figure, Figure)
    figure.colorbar(drawn, ax=axes, label=region.label(name))


def _write(region: Region, axes: Axes, areas: list[str]) -> None:
    """Write into each part of the map which of the first areas it belongs to, and at marks what they are."""
    taken = np.zeros((len(region.y.values), len(region.x.values)), dtype=bool)
    for name, (x, y) in region.marks.items():
        axes.annotate(name, (x, y), (8, 0), textcoords="offset points", va="center", **HALO)
        taken |= _near(region, x + 0.1 * float(np.ptp(region.x.values)), y)
    for xs, ys in region.lines.values():
        for x, y in zip(*_visible(region, xs, ys), strict=True):
            taken |= _near(region, float(x), float(y), 0.02, 0.03)
    maps = [region.maps[name] for name in areas]
    apart = len(maps) == 2 and not (maps[0] & maps[1]).any()
    for inside in product((True, False), repeat=len(areas)):
        part = np.ones_like(taken)
        for values, yes in zip(maps, inside, strict=True):
            part &= values if yes else ~values
        place = _widest(part & ~taken) if part.mean() >= SMALLEST else None
        if place is not None:
            x, y = float(region.x.values[place[1]]), float(region.y.values[place[0]])
            axes.text(x, y, _words(region, areas, inside, apart), ha="center", va="center", **HALO)
            taken |= _near(region, x, y)


def _visible(region: Region, xs: Array, ys: Array) -> tuple[Array, Array]:
    """Return 60 points of a curve inside the frame."""
    at = np.linspace(0, len(xs) - 1, 400)
    x, y = (np.interp(at, np.arange(len(xs)), np.asarray(values, dtype=float)) for values in (xs, ys))
    inside = (x >= region.x.values[0]) & (x <= region.x.values[-1])
    inside &= (y >= region.y.values[0]) & (y <= region.y.values[-1])
    step = max(1, int(inside.sum()) // 60)
    return x[inside][::step], y[inside][::step]


def _words(region: Region, areas: list[str], inside: tuple[bool, ...], apart: bool) -> str:
    """Return what holds in a part of the map; none of the areas, or those that it lies in."""
    held = [region.label(name) for name, yes in zip(areas, inside, strict=True) if yes]
    if not held:
        held = ["not: " + region.label(areas[0])] if len(areas) == 1 else ["neither"]
    elif len(held) < len(areas) and not apart:
        held = ["only: " + held[0]]
    return "\nand ".join(textwrap.fill(text, WIDTH) for text in held)


def _widest(part: Mask) -> tuple[int, int] | None:
    """Return the place farthest from the edge of a part; None if all of it is too thin."""
    framed = np.pad(part, 1)
    sampling = (1.0 / part.shape[0], 0.45 / part.shape[1])  # words are wider than high
    distance = np.asarray(distance_transform_edt(framed, sampling=sampling))[1:-1, 1:-1]
    if distance.max() < THINNEST:
        return None
    row, column = np.unravel_index(int(distance.argmax()), part.shape)
    return int(row), int(column)


def _near(region: Region, x: float, y: float, wide: float = 0.16, high: float = 0.07) -> Mask:
    """Return the points of the map around a place, by default as far as words there reach."""
    across = np.abs(region.x.values - x) < wide * np.ptp(region.x.values)
    up = np.abs(region.y.values - y) < high * np.ptp(region.y.values)
    return up[:, None] & across[None, :]
