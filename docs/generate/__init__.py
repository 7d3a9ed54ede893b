"""Pages that the code writes itself: the reference and the gallery.

Each module has ``pages(into)``, which writes Markdown into a folder of docs/ that is not kept in git. They go
by the public lists (effects, scenarios, vehicles, commands, ``__all__``), so that what is added to the code
has its page with the next build.
"""

from __future__ import annotations

import shutil
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

from generate import analyses, api, blocks, commands, effects, evidence, formats, gallery, scenarios, vehicles
from generate.stamps import generators, kept, stamp

#: What is written, in the order of the reference's first page, and the sources of each besides its generator.
PACKAGE = "hovercontrol", "fmu"
PLANTS = "hovercontrol/base", "hovercontrol/blocks", "hovercontrol/craft"
PARTS = (
    (effects, (*PLANTS, "hovercontrol/identification/diagnose/experiment")),
    (vehicles, PLANTS),
    (blocks, (*PLANTS, "hovercontrol/control")),
    (scenarios, (*PLANTS, "hovercontrol/control", "hovercontrol/documents", "fmu")),
    (analyses, (*PACKAGE, "analyses", "docs/pictures")),
    (commands, PACKAGE),
    (formats, PACKAGE),
    (api, PACKAGE),
    (evidence, (*PACKAGE, "docs/pictures", "tests/identification/diagnose/blind")),
)


def generate(docs: Path) -> None:
    """Write the generated pages below ``docs/reference`` and ``docs/gallery`` whose sources have changed."""
    reference = docs / "reference"
    reference.mkdir(exist_ok=True)
    lines = ["# Reference", "", "These pages are generated from the code.", ""]
    with ProcessPoolExecutor(2, mp_context=get_context("fork")) as pool:  # effects and scenarios take longest
        found = [pool.submit(_written, k, reference) for k in range(len(PARTS))]
        lines += [one.result() for one in found]
    names = [part.__name__.rpartition(".")[2] for part, _ in PARTS]
    text = "\n".join([*lines, "", "```{toctree}", ":hidden:", "", *names, "```", ""])
    (reference / "index.md").write_text(text, encoding="utf-8")
    gallery.pages(docs / "gallery")


def _written(k: int, reference: Path) -> str:
    """Write a part of the reference, or keep it; return its line on the first page."""
    part, sources = PARTS[k]
    own = part.__name__.rpartition(".")[2]
    place, now = reference / f".{own}", stamp([*sources, *generators(part)])
    if line := kept(place, now):
        return line
    begin = time.monotonic()
    shutil.rmtree(reference / own, ignore_errors=True)
    name, count = part.pages(reference)
    title = (part.__doc__ or "").partition(":")[0]
    print(f"reference: {name}, {count}: {time.monotonic() - begin:.1f} s", flush=True)
    line = f"- [{title}]({name}.md): {count}"
    place.write_text(f"{now}\n{line}", encoding="utf-8")
    return line
