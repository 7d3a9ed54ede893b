"""What the site needs of Sphinx beside its extensions: formulas as MathML, shell cells shown as commands."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.transforms.post_transforms import SphinxPostTransform

#: The first line of a cell that holds commands; nobody types it.
MAGIC = "%%bash\n"


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    self.body.append(f"<div class='formula'>{tex2mathml(node.astext(), as_block=True)}</div>")
    raise nodes.SkipNode


class Commands(SphinxPostTransform):
    """Show cells of commands as commands, without the line that hands them to the shell."""

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


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx of both."""
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.add_post_transform(Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
