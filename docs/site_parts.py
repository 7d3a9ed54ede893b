"""What the site needs of Sphinx: formulas as MathML, cells of commands shown as such, bars in docstrings."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from myst_nb.core import render
from myst_nb.core.utils import coalesce_streams
from sphinx.transforms.post_transforms import SphinxPostTransform

#: The first line of a cell that holds commands, nobody types it; and of one that is a file.
MAGIC, FILE = "%%bash\n", "%%writefile "


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    self.body.append(f"<div class='formula'>{tex2mathml(node.astext(), as_block=True)}</div>")
    raise nodes.SkipNode


class Commands(SphinxPostTransform):
    """Show cells of commands as commands, and those that write a file as that file."""

    default_priority = 5

    def run(self, **kwargs: Any) -> None:
        """Change every such cell of a page."""
        for node in self.document.findall(nodes.literal_block):
            text = node.astext()
            if text.startswith(MAGIC):
                shown = text.removeprefix(MAGIC).replace(" || true", "")
                node.rawsource, node.children = shown, []
                node += nodes.Text(shown)
                node["language"] = "sh"
            elif text.startswith(FILE):
                shown = text.replace(FILE, "# ", 1)
                node.rawsource, node.children = shown, []
                node += nodes.Text(shown)


def plain_bars(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Let bars of a docstring be absolute values, not substitutions."""
    for k, line in enumerate(lines):
        parts = re.split(r"(``.*?``)", line)
        lines[k] = "".join(p if p.startswith("``") else p.replace("|", "\\|") for p in parts)


def joined_streams(outputs: list[Any]) -> list[Any]:
    """Return outputs of a cell, each stream in one piece: MyST-NB itself breaks lines between pieces."""
    found: list[Any] = []
    streams: dict[str, Any] = {}
    for output in outputs:
        if output["output_type"] == "stream" and output["name"] in streams:
            streams[output["name"]]["text"] += output["text"]
            continue
        if output["output_type"] == "stream":
            streams[output["name"]] = output
        found.append(output)
    return coalesce_streams(found)


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx of all of them."""
    render.coalesce_streams = joined_streams
    app.connect("autodoc-process-docstring", plain_bars)
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.add_post_transform(Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
