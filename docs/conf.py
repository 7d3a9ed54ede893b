"""How the site is built: ``make docs``.

Pages are Markdown whose outputs are kept in them (docs/generate/cells.py); no cell runs here. Reference and
gallery are written by docs/generate from the code.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import hovercontrol  # noqa: E402

project = "hovercontrol"
author = "The hovercontrol developers"
copyright = author
version = release = hovercontrol.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "site_parts",
]
exclude_patterns = ["_build", "generate", "**.ipynb_checkpoints"]
myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_inline", "deflist"]
myst_heading_anchors = 3

# Attributes of one name in several classes are no broken links.
suppress_warnings = ["ref.python"]

smartquotes = False  # `--list` would become a dash

# The docstrings' single backticks are names of arguments.
default_role = "literal"
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings tell the types with shapes and units
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_custom_sections = ["Shapes"]
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True

html_theme = "furo"
html_title = "hovercontrol"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_math_renderer = "mathml"  # no script, nothing from elsewhere
html_show_sourcelink = False
html_copy_source = True
html_show_search_summary = True
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#00598c", "color-brand-content": "#00598c"},
    "dark_css_variables": {"color-brand-primary": "#7cc4f0", "color-brand-content": "#7cc4f0"},
}


def own_branch(app: Any, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Let the side bar unfold the page's own branch only: all 500 in each took most of the build."""
    whole = context.get("toctree")
    if whole:
        context["toctree"] = lambda **options: whole(**{**options, "collapse": True})


def setup(app: Any) -> None:
    """Write reference and gallery first; ``sphinx-build -t keep`` keeps those of the last build."""
    from generate import generate

    app.connect("html-page-context", own_branch, priority=400)  # before the theme takes it
    if not app.tags.has("keep"):
        app.connect("config-inited", lambda app, config: generate(Path(app.srcdir)))
