"""K06's diagrams of what has no numbers: the Bluetooth stack, the two microcontrollers, their order here."""

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


@rebuilds("k06", "fig 5.3", lacks="a diagram has no numbers")
def fig_5_3(folder: Path) -> Mapping[str, float]:
    """Draw the layers of Bluetooth that a command passes [K06 fig 5.3]."""
    places = {name: (0.5, (k + 0.5) / len(STACK)) for k, name in enumerate(STACK)}
    figure = Figure(figsize=(4.5, 5.5), layout="constrained")
    _draw(figure.subplots(), places, [*pairwise(STACK)])
    figure.savefig(folder / "stack.png", dpi=130)
    return {}


def _microcontroller(own: str, parts: Sequence[tuple[str, str]]):  # type: ignore[no-untyped-def]
    """Return what draws a microcontroller and what is joined to it, as section 5.2 says.

    [K06 fig A.1, A.2]
    """

    def draw(folder: Path) -> Mapping[str, float]:
        places: dict[str, Place] = {own: (0.18, 0.5)}
        places |= {name: (0.8, (k + 0.5) / len(parts)) for k, (name, _) in enumerate(parts)}
        figure = Figure(figsize=(7.0, 0.75 * len(parts) + 0.6), layout="constrained")
        _draw(figure.subplots(), places, [(own, name) for name, _ in parts], dict(parts))
        figure.savefig(folder / "parts.png", dpi=130)
        return {}

    return draw


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


_MASTER = (
    ("dSPACE", "Bluetooth, RS-232"),
    ("IMU", "RS-232"),
    ("radio receiver of the safety pilot", "PWM"),
    ("servo, thrust fan", "PWM"),
    ("encoder of the fan", "pulses"),
    ("slave", "I2C"),
)
_SLAVE = (
    ("lift fan", "PWM"),
    ("first Cricket unit", "RS-232"),
    ("second Cricket unit", "RS-232"),
    ("master", "I2C"),
)
_WIRING = "the drawing in the text: here is what section 5.2 says is joined, not the wiring"

rebuilds("k06", "fig A.1", lacks=_WIRING)(_microcontroller("master\n(PIC 18F8720)", _MASTER))
rebuilds("k06", "fig A.2", lacks=_WIRING)(_microcontroller("slave\n(PIC 18F8720)", _SLAVE))
