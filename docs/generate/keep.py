"""Pictures that the site keeps because they take minutes: ``python -m generate.keep`` (``make pictures``).

Every analysis and every item of ``hovercontrol analyze`` runs once; PNGs of few colours, findings and indexes
go into docs/pictures. ``python -m generate.keep readme`` draws README's picture alone.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

from PIL import Image

from generate import analyses, evidence
from hovercontrol.app.commands.analyze import known_scripts

DOCS = Path(__file__).parents[1]

#: Width of a kept picture [pixel], and its colours.
WIDE, COLOURS = 900, 64

#: Items of which the site shows the picture; the others are numbers.
SHOWN = {
    "c17": ("fig 2", "fig 3", "fig 4", "fig 5", "fig 11", "fig 12", "fig 13", "fig 15"),
    "k06": (
        "fig 4.4",
        "fig 6.7",
        "fig 6.8",
        "fig 6.9",
        "fig 6.10",
        "fig 6.12",
        "fig 6.20",
        "fig 6.24",
        "fig 6.27",
    ),
}


def main(out: Path) -> None:
    """Run what is not in `out` yet, and keep its pictures."""
    for name in known_scripts():
        if not (out / name).is_dir():
            _run("analyze", name, "--out", str(out / name))
        for picture in sorted((out / name).glob("*.png")):
            keep(picture, analyses.KEPT / picture.name)
            text = picture.with_suffix(".txt").read_text(encoding="utf-8")
            (analyses.KEPT / f"{picture.stem}.txt").write_text(text, encoding="utf-8")
    for document, items in SHOWN.items():
        folder = out / document
        if not folder.is_dir():
            _run("analyze", "--document", document, "--out", str(folder))
        index = (folder / "index.json").read_text(encoding="utf-8")
        (evidence.KEPT / f"{document}.json").write_text(index + "\n", encoding="utf-8")
        for item in items:
            found = sorted((folder / f"{document}_{item}".replace(" ", "_").replace(".", "_")).glob("*.png"))
            if found:
                keep(found[0], evidence.KEPT / f"{document}-{item.replace(' ', '_')}.png")


def keep(picture: Path, place: Path) -> None:
    """Write a picture small: no wider than the page, few colours."""
    with Image.open(picture) as found:
        image = found.convert("RGB")
    if image.width > WIDE:
        image = image.resize((WIDE, round(image.height * WIDE / image.width)), Image.Resampling.LANCZOS)
    image.quantize(COLOURS).save(place, optimize=True)


def readme() -> None:
    """Draw README's picture by the first lines of README's example, up to the picture."""
    import matplotlib

    matplotlib.use("Agg")
    text = (DOCS.parent / "README.md").read_text(encoding="utf-8")
    block = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)[0]
    lines, drawing = re.split(r"^(hc\.plot_path.*)$", block, flags=re.MULTILINE)[:2]
    names: dict[str, Any] = {}
    exec(lines, names)
    figure = eval(drawing, names)
    figure.set_size_inches(5.6, 5.6)
    place = DOCS / "craft.png"
    figure.savefig(place, dpi=110)
    keep(place, place)


def _run(*words: str) -> None:
    done = subprocess.run([sys.executable, "-m", "hovercontrol", *words], check=False)
    if done.returncode > 1:  # 1: done, and something differs
        raise SystemExit(done.returncode)


if __name__ == "__main__":
    readme()
    if sys.argv[1:] != ["readme"]:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/pictures"))
