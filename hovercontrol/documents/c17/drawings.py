"""The two drawings of C17: the craft with its frames, and what measures, computes and sends."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.documents.printed import rebuilds


def craft(psi: float = 0.5, arm: float = 0.14, control_point: float = 0.2, rudder: float = 0.4) -> Figure:
    """Return a sketch of the craft from above, inertial and body frame, control point and rudder [C17 fig 1].

    Parameters
    ----------
    psi, rudder : float, optional
        Heading and rudder angle [rad].
    arm, control_point : float, optional
        Behind and ahead of the centre of mass [m].
    """
    figure = Figure(figsize=(5.5, 5.5), layout="constrained")
    axes = figure.subplots()
    turn = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
    centre = np.array([0.35, 0.3])

    def at(x: float, y: float) -> Array:
        return centre + turn @ [x, y]

    angle = np.linspace(0, 2 * np.pi, 200)
    hull = np.array([at(0.225 * np.cos(a), 0.125 * np.sin(a)) for a in angle])
    axes.plot(*hull.T, "k-")

    def arrow(start: Array, end: Array, text: str, color: str = "black") -> None:
        style = {"arrowstyle": "->", "color": color, "linewidth": 1.5}
        axes.annotate("", (end[0], end[1]), (start[0], start[1]), arrowprops=style)
        axes.text(end[0] + 0.01, end[1] + 0.01, text, color=color)

    origin = np.zeros(2)
    arrow(origin, np.array([0.15, 0.0]), "x")
    arrow(origin, np.array([0.0, 0.15]), "y")
    arrow(origin, centre, "")
    axes.text(0.13, 0.09, "p")
    arrow(at(0, 0), at(0.13, 0), "u", "C0")
    arrow(at(0, 0), at(0, 0.13), "v", "C0")
    end = at(-arm, 0)
    axes.plot(*np.array([at(0, 0), end]).T, "k:")
    middle, marked = at(-arm / 2, 0.012), at(control_point - 0.06, 0.01)
    axes.text(middle[0], middle[1], "a")
    axes.plot(*np.array([end, end + 0.08 * turn @ [-np.cos(rudder), -np.sin(rudder)]]).T, "C3-", linewidth=3)
    arrow(end, end + 0.12 * turn @ [np.cos(rudder), np.sin(rudder)], "", "C3")
    axes.text(end[0] + 0.03, end[1] + 0.1, "T, theta", color="C3", ha="right")
    axes.plot(*at(control_point, 0), "o", color="C2")
    axes.text(marked[0], marked[1], "delta", color="C2")
    axes.set(xlabel="x [m]", ylabel="y [m]", title="frames, control point delta, rudder at arm a")
    axes.set(xlim=(-0.03, 0.65), ylim=(-0.03, 0.55))
    axes.set_aspect("equal")
    axes.grid(alpha=0.3)
    return figure


def architecture(blocks: Mapping[str, Block]) -> Figure:
    """Return the Blocks of a sampled loop, each with its period, and what goes from one to the next.

    Parameters
    ----------
    blocks : mapping of str to Block
        Of :func:`hovercontrol.documents.scenarios.sampling.sampled_blocks`: plant, sensor, reference,
        computer, radio.
    """
    places = {"plant": (0.1, 0.7), "sensor": (0.5, 0.7), "computer": (0.9, 0.7), "radio": (0.5, 0.2)}
    places |= {"reference": (0.9, 0.2)}
    figure = Figure(figsize=(9.0, 4.0), layout="constrained")
    axes = figure.subplots()
    for name, place in places.items():
        period = blocks[name].period
        text = f"{name}\nevery {1e3 * period:g} ms" if period else f"{name}\ncontinuous"
        box = {"boxstyle": "round,pad=0.6", "facecolor": "white"}
        axes.text(place[0], place[1], text, ha="center", va="center", bbox=box)
    ways = (("plant", "sensor"), ("sensor", "computer"), ("reference", "computer"), ("computer", "radio"))
    for one, other in (*ways, ("radio", "plant")):
        inputs = {s.name for s in blocks[other].inputs}
        wires = [s.name for s in blocks[one].outputs if s.name in inputs]
        start, end = np.array(places[one]), np.array(places[other])
        way = 0.2 * (end - start)
        head, tail = end - way, start + way
        axes.annotate("", (head[0], head[1]), (tail[0], tail[1]), arrowprops={"arrowstyle": "->"})
        said = "\n".join(wires[:3]) + (" ..." if len(wires) > 3 else "")
        x, y = (start + end) / 2
        axes.text(x, y, said, ha="center", va="center", fontsize=7, backgroundcolor="white")
    axes.set(xlim=(-0.05, 1.05), ylim=(0, 0.95), title="what measures, computes and sends (Table II)")
    axes.set_axis_off()
    return figure


@rebuilds("c17", "fig 1", lacks="a drawing has no numbers")
def fig_1(folder: Path) -> Mapping[str, float]:
    """Draw the craft, its frames and its control point."""
    craft().savefig(folder / "craft.png", dpi=130)
    return {}
