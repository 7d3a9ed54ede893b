"""Figures that users see: ``plt.show()`` shows them in a script, and a notebook shows each once.

Internal functions return a ``matplotlib.figure.Figure`` that is not registered with pyplot, for files,
commands and threads. Only a ``plot`` that a user calls opens it in pyplot, at the very end.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What IPython calls to show an object.
HOOK = "_ipython_display_"


def open_in_pyplot(figure: Figure) -> Figure:
    """Register a figure with pyplot as the current one, and return it.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Made without pyplot.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from matplotlib.figure import Figure
    >>> figure = open_in_pyplot(Figure())
    >>> plt.gcf() is figure
    True
    >>> plt.close(figure)
    """
    import matplotlib.pyplot as plt

    plt.figure(FigureClass=lambda *_, **__: figure)
    return shown_once(figure)


def shown_once(figure: Figure) -> Figure:
    """Return a figure that a notebook shows once where it is open in pyplot and the value of a cell, too.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        Open in pyplot or not.
    """
    setattr(figure, HOOK, partial(_display, figure))
    return figure


def in_front() -> Figure | None:
    """Return pyplot's current figure; None where none is open."""
    import matplotlib.pyplot as plt

    return plt.gcf() if plt.get_fignums() else None


def _display(figure: Figure) -> None:
    """Show a figure as the value of a cell, or as one that is open where a cell ends.

    Of the open ones Jupyter's backend asks for each in turn at the end of a cell, after the cell's value.
    So what was opened before the value is shown before it, and what is shown is closed: none comes twice.
    """
    import matplotlib.pyplot as plt

    opened = _open_figures()
    if figure not in opened:
        _send(figure)
    elif "inline" in plt.get_backend():  # another backend has shown it, or is one that shows nothing
        for earlier in opened[: opened.index(figure) + 1]:
            if HOOK in vars(earlier):
                _send(earlier)
                plt.close(earlier)


def _open_figures() -> list[Figure]:
    import matplotlib.pyplot as plt

    numbers = plt.get_fignums()
    current = plt.gcf().number if numbers else 0
    figures = [plt.figure(number) for number in numbers]
    if numbers:
        plt.figure(current)
    return figures


def _send(figure: Figure) -> None:
    """Show a figure in the formats that the notebook is set to."""
    from IPython.display import display

    hook = vars(figure).pop(HOOK)
    display(figure)
    setattr(figure, HOOK, hook)
