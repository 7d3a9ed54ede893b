"""Pages that the code writes itself: the reference and the gallery.

Each module has ``pages(into)``, which writes Markdown into a folder of docs/ that is not kept in git. They go
by the public lists (effects, scenarios, vehicles, commands, ``__all__``), so that what is added to the code
has its page with the next build.
"""

from __future__ import annotations

import os
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from generate import analyses, api, blocks, commands, effects, evidence, formats, gallery, scenarios, vehicles
from generate.pages import clean

#: What is written, in the order of the reference's first page.
PARTS = (effects, vehicles, blocks, scenarios, analyses, commands, formats, api, evidence)


def generate(docs: Path) -> None:
    """Write all generated pages below ``docs/reference`` and ``docs/gallery``."""
    reference = docs / "reference"
    clean(reference)
    lines = ["# Reference", "", "These pages are generated from the code.", ""]
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as pool:  # effects and scenarios take longest
        found = [pool.submit(_written, k, reference) for k in range(len(PARTS))]
        lines += [one.result() for one in found]
    names = [part.__name__.rpartition(".")[2] for part in PARTS]
    lines += ["", "```{toctree}", ":hidden:", "", *names, "```", ""]
    (reference / "index.md").write_text("\n".join(lines), encoding="utf-8")
    gallery.pages(docs / "gallery")


def _written(k: int, reference: Path) -> str:
    """Write a part of the reference; return its line on the first page."""
    begin, spent = time.monotonic(), sum(os.times()[:4])
    name, count = PARTS[k].pages(reference)
    title = (PARTS[k].__doc__ or "").partition(":")[0]
    took = f"{time.monotonic() - begin:.1f} s, {sum(os.times()[:4]) - spent:.1f} s of processor time"
    print(f"reference: {name}, {count}: {took}", flush=True)
    return f"- [{title}]({name}.md): {count}"
