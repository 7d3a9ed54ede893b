"""K06's diagrams without numbers: the Bluetooth stack, the two microcontrollers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hovercontrol.documents.printed import rebuilds

Place = tuple[float, float]

#: Layers from the antenna up, as section 5.3.2 orders them.
STACK = ("radio", "baseband", "link manager", "host controller interface", "L2CAP", "RFCOMM", "application")

#: Parts of each microcontroller, by what joins them.
MASTER = {
    "dSPACE": "Bluetooth, RS-232",
    "IMU": "RS-232",
    "radio receiver of the safety pilot": "PWM",
    "servo, thrust fan": "PWM",
    "encoder of the fan": "pulses",
    "slave": "I2C",
}
SLAVE = {
    "lift fan": "PWM",
    "first Cricket unit": "RS-232",
    "second Cricket unit": "RS-232",
    "master": "I2C",
}
WIRING = "the drawing in the text: here is what section 5.2 says is joined, not the wiring"


@rebuilds("k06", "fig 5.3", lacks="a diagram has no numbers")
def fig_5_3(folder: Path) -> Mapping[str, float]:
    """Draw the layers of Bluetooth that a command passes [K06 fig 5.3]."""
    places = {name: (0.5, (k + 0.5) / len(STACK)) for k, name in enumerate(STACK)}
    figure = Figure(figsize=(4.5, 5.5), layout="constrained")
    _draw(figure.subplots(), places, [*pairwise(STACK)])
    figure.savefig(folder / "stack.png", dpi=130)
    return {}


@rebuilds("k06", "fig A.1", lacks=WIRING)
def fig_a_1(folder: Path) -> Mapping[str, float]:
    """Draw the master microcontroller and what is joined to it, as section 5.2 says [K06 fig A.1]."""
    return _microcontroller(folder, "master\n(PIC 18F8720)", MASTER)


@rebuilds("k06", "fig A.2", lacks=WIRING)
def fig_a_2(folder: Path) -> Mapping[str, float]:
    """Draw the slave microcontroller and what is joined to it, as section 5.2 says [K06 fig A.2]."""
    return _microcontroller(folder, "slave\n(PIC 18F8720)", SLAVE)


def _microcontroller(folder: Path, own: str, parts: Mapping[str, str]) -> Mapping[str, float]:
    places: dict[str, Place] = {own: (0.18, 0.5)}
    places |= {name: (0.8, (k + 0.5) / len(parts)) for k, name in enumerate(parts)}
    figure = Figure(figsize=(7.0, 0.75 * len(parts) + 0.6), layout="constrained")
    _draw(figure.subplots(), places, [(own, name) for name in parts], parts)
    figure.savefig(folder / "parts.png", dpi=130)
    return {}


def _draw(
    axes: Axes,
    places: Mapping[str, Place],
    joined: Sequence[tuple[str, str]],
    by: Mapping[str, str] | None = None,
) -> None:
    for a, b in joined:
        axes.annotate("", places[b], places[a], arrowprops={"arrowstyle": "<->", "color": "0.5"}, zorder=1)
        if by:
            x, y = (0.45 * p + 0.55 * q for p, q in zip(places[a], places[b], strict=True))
            axes.text(x, y, by[b], fontsize=8, ha="center", va="center", backgroundcolor="white")
    for name, place in places.items():
        box = {"boxstyle": "round", "facecolor": "white", "edgecolor": "black"}
        axes.text(*place, name, ha="center", va="center", bbox=box, zorder=2)
    axes.set(xlim=(0.0, 1.0), ylim=(0.0, 1.0))
    axes.set_axis_off()
