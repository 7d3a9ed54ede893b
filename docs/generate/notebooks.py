"""The pages as Jupyter notebooks: ``make notebooks``. Cells are those of the page; outputs come when they run."""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path
from typing import Any

from generate.cells import CELL, DOCS, bare, pages


def notebook(page: Path, into: Path) -> dict[str, Any]:
    """Return a page as a notebook that lies in the folder `into`."""
    text, cells, at = bare(page.read_text(encoding="utf-8")), [], 0

    def markdown(part: str) -> None:
        moved = re.sub(
            r"\]\((?!\w+:|#)([^)\s]+)\)",
            lambda m: f"]({os.path.relpath(page.parent / m[1], into)})",
            part,
        )
        if part.strip():
            cells.append({"cell_type": "markdown", "metadata": {}, "source": moved.strip()})

    for cell in CELL.finditer(text):
        markdown(text[at : cell.start()])
        at = cell.end()
        code, words = cell["code"] or "", cell["words"] or ""
        if cell["hidden"]:
            code = cell["hidden"]
        elif cell["picture"]:
            code = f"from IPython.display import Image\nfrom pathlib import Path\nImage(next(Path().glob({cell['picture']!r})))"
        elif words.startswith("file="):
            code = f"%%writefile {words.removeprefix('file=')}\n{code}"
        elif words.startswith("from="):
            markdown(f"```{cell['language']}\n{code}```")
            continue
        elif cell["language"] == "sh":
            code = f"%%bash\n{code}"
        tags = {"tags": ["raises-exception"]} if "fails" in words else {}
        cells.append(
            {
                "cell_type": "code",
                "metadata": tags,
                "execution_count": None,
                "outputs": [],
                "source": code.strip(),
            }
        )
    markdown(text[at:])
    for k, one in enumerate(cells):
        one["id"] = f"cell-{k}"
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return {"nbformat": 4, "nbformat_minor": 5, "metadata": {"kernelspec": kernel}, "cells": cells}


def main(into: Path) -> None:
    """Write every page with cells as a notebook."""
    into.mkdir(parents=True, exist_ok=True)
    found = [page for page in pages() if CELL.search(page.read_text(encoding="utf-8"))]
    for page in found:
        name = "-".join(page.relative_to(DOCS).with_suffix("").parts)
        text = json.dumps(notebook(page, into), indent=1, ensure_ascii=False)
        (into / f"{name}.ipynb").write_text(text + "\n", encoding="utf-8")
    print(f"{len(found)} notebooks: {into}")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/notebooks").resolve())
