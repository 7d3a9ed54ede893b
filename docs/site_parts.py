"""What the site makes of pages that a code host shows as they stand: links, chapters, formulas, bars."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx import addnodes
from sphinx.transforms import SphinxTransform

#: What a link to a file of the checkout is on the site: the page that the code has in the reference.
PAGES = (
    (r"analyses/(\w+)\.py", r"reference/analyses/\1.md"),
    (r"analyses", "reference/analyses.md"),
    (r"hovercontrol/documents/scenarios/([\w-]+)\.toml", r"reference/scenarios/\1.md"),
    (r"hovercontrol/craft/effects", "reference/effects.md"),
    (r"hovercontrol/craft/hardware", "reference/blocks.md"),
    (r"hovercontrol/app/commands/(\w+)\.py", r"reference/commands/\1.md"),
    (r"hovercontrol/app/commands", "reference/commands.md"),
    (r"hovercontrol/app/schema", "reference/formats.md"),
    (r"tests/identification/diagnose/blind/table\.md", "reference/evidence/blind.md"),
    (r"tests/identification/diagnose/blind/criteria\.md", "reference/evidence/criteria.md"),
    (r"docs/pictures/reproduce/(c17|k06)\.json", r"reference/evidence/\1.md"),
    (r"docs/pictures/reproduce", "reference/evidence.md"),
    (r"docs/pictures", "gallery/index.md"),
    (r"hovercontrol/__init__\.pyi", "reference/index.md"),
)
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\(([^)\s#]+)(#[^)\s]*)?\)")
FENCED = re.compile(r"^(`{3,}).*?^\1", re.MULTILINE | re.DOTALL)


def site_link(page: Path, docs: Path, found: re.Match[str]) -> str:
    """Return a link of a page as it is on the site; a file that has no page there is text."""
    text, path, anchor = found[1], found[2], found[3] or ""
    full = os.path.normpath(page.parent / path)
    if re.match(r"\w+:", path) or (Path(full).is_relative_to(docs) and full.endswith((".md", ".py"))):
        return found[0]
    name = os.path.relpath(full, docs.parent)
    for pattern, target in PAGES:
        if match := re.fullmatch(pattern, name):
            return f"[{text}]({os.path.relpath(docs / match.expand(target), page.parent)}{anchor})"
    return text


def as_on_the_site(app: Any, docname: str, source: list[str]) -> None:
    """Change links to code into links to its page in the reference; give each index its chapter's pages."""
    docs, page = Path(app.srcdir), Path(app.env.doc2path(docname))
    if docname.startswith(("reference/", "gallery/")):
        return
    parts, at, text = [], 0, source[0]
    for fence in FENCED.finditer(text):
        parts += [LINK.sub(lambda m: site_link(page, docs, m), text[at : fence.start()]), fence[0]]
        at = fence.end()
    parts.append(LINK.sub(lambda m: site_link(page, docs, m), text[at:]))
    source[0] = "".join(parts)
    if page.stem == "index":
        source[0] = chapters(source[0])


def chapters(text: str) -> str:
    """Return an index with hidden lists, for the side bar, of the pages that each section links to."""
    title, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    done: set[str] = set()
    lists = []
    for section in [title, *sections]:
        names = [m[2] for m in LINK.finditer(section) if m[2].endswith(".md") and not m[2].startswith("../")]
        new = [name.removesuffix(".md") for name in dict.fromkeys(names) if name not in done]
        done |= {f"{name}.md" for name in new}
        caption = [f":caption: {section.splitlines()[0]}"] if section is not title else []
        if new:
            lists.append("\n".join(["```{toctree}", ":hidden:", *caption, "", *new, "```"]))
    return "\n\n".join([text.rstrip("\n"), *lists]) + "\n"


class Names(SphinxTransform):
    """Link names of the package in the text, `hc.lqr`, to their pages."""

    default_priority = 400

    def apply(self, **kwargs: Any) -> None:
        """Change every such literal of a page."""
        docname = self.env.docname
        found = [] if docname.startswith(("reference/", "gallery/")) else self.document.findall(nodes.literal)
        for node in list(found):
            name = re.fullmatch(r"(?:hc|hovercontrol)((?:\.\w+)+)(?:\(.*\))?", node.astext())
            if not name or isinstance(node.parent, nodes.reference | nodes.title):
                continue
            link = addnodes.pending_xref(
                "", refdomain="py", reftype="obj", reftarget=f"hovercontrol{name[1]}", refexplicit=True,
                refwarn=False, refdoc=docname,
            )  # fmt: skip
            node.replace_self(link)
            link += node


def _inline(self: Any, node: nodes.math) -> None:
    self.body.append(tex2mathml(node.astext()))
    raise nodes.SkipNode


def _block(self: Any, node: nodes.math_block) -> None:
    self.body.append(f"<div class='formula'>{tex2mathml(node.astext(), as_block=True)}</div>")
    raise nodes.SkipNode


def plain_bars(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Let bars of a docstring be absolute values, not substitutions."""
    for k, line in enumerate(lines):
        parts = re.split(r"(``.*?``)", line)
        lines[k] = "".join(p if p.startswith("``") else p.replace("|", "\\|") for p in parts)


def setup(app: Any) -> dict[str, bool]:
    """Tell Sphinx of all of them."""
    app.connect("source-read", as_on_the_site)
    app.connect("autodoc-process-docstring", plain_bars)
    app.add_html_math_renderer("mathml", inline_renderers=(_inline, None), block_renderers=(_block, None))
    app.add_transform(Names)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
