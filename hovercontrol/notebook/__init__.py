"""How objects show themselves in a notebook, without any script, and bars of progress.

The classes' ``_repr_html_`` and ``plot`` call what is here; nothing of it is imported before.
"""

from hovercontrol.notebook.progress import progress_bar

__all__ = ["progress_bar"]
