"""Style of the package's figures: colours for the colour-blind, light grids, no frames."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

#: Okabe and Ito's colours, in an order in which the fourth is the one that warns (Matplotlib's C3).
BLUE, YELLOW, GREEN, VERMILION, PURPLE, SKY, BLACK = COLOURS = (
    "#0072B2", "#E69F00", "#009E73", "#D55E00", "#CC79A7", "#56B4E9", "#000000",
)  # fmt: skip

#: Of quantities over an area: its lightness grows with the value, so that it survives in grey.
COLOUR_MAP = "cividis"


@contextmanager
def figure_style() -> Iterator[None]:
    """Draw in the package's style inside a ``with``; outside, the user's Matplotlib settings are unchanged.

    Examples
    --------
    >>> import matplotlib
    >>> with figure_style():
    ...     matplotlib.rcParams["axes.prop_cycle"].by_key()["color"][0]
    '#0072B2'
    """
    import matplotlib
    from cycler import cycler

    settings = {
        "axes.prop_cycle": cycler(color=COLOURS),
        "axes.spines.top": False,
        "axes.spines.right": False,
        "axes.titlesize": "medium",
        "figure.titlesize": "large",
        "grid.alpha": 0.3,
        "hatch.linewidth": 0.6,
        "image.cmap": COLOUR_MAP,
        "legend.frameon": False,
        "svg.hashsalt": "hovercontrol",
    }
    with matplotlib.rc_context(settings):
        yield
