"""HTML for notebooks, without scripts, and progress bars.

Each package with results has a module ``display`` with their figures and HTML.
"""

from hovercontrol.display.progress import progress_bar

__all__ = ["progress_bar"]
