"""Pages that the code writes itself: the reference and the gallery.

Each module has ``pages(into)``, which writes Markdown into a folder of docs/ that is not kept in git. They go
by the public lists (effects, scenarios, vehicles, commands, ``__all__``), so that what is added to the code
has its page with the next build.
"""

from __future__ import annotations

import time
from pathlib import Path

from generate import analyses, api, blocks, commands, effects, evidence, formats, gallery, scenarios, vehicles
from generate.pages import clean

#: What is written, in the order of the reference's first page.
PARTS = (effects, vehicles, blocks, scenarios, analyses, commands, formats, api, evidence)


def generate(docs: Path) -> None:
    """Write all generated pages below ``docs/reference`` and ``docs/gallery``."""
    reference = docs / "reference"
    clean(reference)
    lines = ["# Reference", "", "All of it is written by the code itself.", ""]
    for part in PARTS:
        begin = time.monotonic()
        name, count = part.pages(reference)
        title = (part.__doc__ or "").partition(":")[0]
        lines.append(f"- [{title}]({name}.md): {count}")
        print(f"reference: {name}, {count}, {time.monotonic() - begin:.1f} s", flush=True)
    names = [part.__name__.rpartition(".")[2] for part in PARTS]
    lines += ["", "```{toctree}", ":hidden:", "", *names, "```", ""]
    (reference / "index.md").write_text("\n".join(lines), encoding="utf-8")
    gallery.pages(docs / "gallery")
