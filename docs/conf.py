"""How the site is built: ``make docs``. Reference and gallery are written by docs/generate from the code."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

os.environ["HOVERCONTROL_TUTORIALS"] = str(HERE / "tutorials")  # the cells run in folders of their own
os.environ |= {"COLUMNS": "110", "NO_COLOR": "1"}  # tables of commands on a page

import hovercontrol  # noqa: E402

project = "hovercontrol"
author = "The hovercontrol developers"
copyright = author
version = release = hovercontrol.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "site_parts",
]
exclude_patterns = ["_build", "generate", "**.ipynb_checkpoints"]
myst_enable_extensions = ["colon_fence", "dollarmath", "attrs_inline", "deflist"]
myst_heading_anchors = 3

# Every code cell runs in the build; one that fails stops it.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_timeout = 900  # of a cell, on a busy machine
nb_execution_raise_on_error = True
nb_merge_streams = True
nb_render_markdown_format = "myst"  # tables
nb_mime_priority_overrides = [("html", "text/html", 0)]

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


#: How many pages Sphinx gives to a process at a time, about.
CHUNK = 50


def spread(app: Any, env: Any, docnames: list[str]) -> None:
    """Spread the pages with cells evenly: processes read parts, and one would get all tutorials."""
    slow = [name for name in docnames if "kernelspec" in Path(env.doc2path(name)).read_text("utf-8")[:200]]
    quick = [name for name in docnames if name not in set(slow)]
    for k, name in enumerate(slow):
        quick.insert(min(k * CHUNK // 2, len(quick)), name)
    docnames[:] = quick


def own_branch(app: Any, page: str, template: str, context: dict[str, Any], doctree: Any) -> None:
    """Let the side bar unfold the page's own branch only: all 500 in each took most of the build."""
    whole = context.get("toctree")
    if whole:
        context["toctree"] = lambda **options: whole(**{**options, "collapse": True})


def setup(app: Any) -> None:
    """Write reference and gallery first; ``sphinx-build -t keep`` keeps those of the last build."""
    from generate import generate

    app.connect("env-before-read-docs", spread)
    app.connect("html-page-context", own_branch, priority=400)  # before the theme takes it
    if not app.tags.has("keep"):
        app.connect("config-inited", lambda app, config: generate(Path(app.srcdir)))
