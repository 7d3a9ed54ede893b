"""Cells of pages: run, and what they print and draw written below them: ``make pages``.

A page is Markdown that a code host shows as it stands. Fences with one of these words are cells::

    ```python run          Python: what it prints, its last value and its open figures are the output
    ```sh run              commands of the shell
    ```python file=a.py    a file that later cells use
    ```python from=a.py "first line" "last line"     lines of a script beside the page (... before: without the last)
    <!-- run ... -->       Python that readers do not see; what it prints is Markdown
    <!-- picture a.png --> a picture that a cell wrote

``run fails`` says that the cell ends with an error, which is its output; ``run silent`` that it has none. Each
page runs in a process and an empty folder of its own. Its last line has a hash of its cells: a page is run only
where that differs, or with ``--all``. Pictures are PNGs of few colours in docs/outputs.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import textwrap
import traceback
import types
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]
OUTPUTS = DOCS / "outputs"

CELL = re.compile(
    r"^(?P<fence>`{3,})(?P<language>python|sh|toml|text|c) (?P<words>(?:run|file=|from=)[^\n]*)\n"
    r"(?P<code>.*?)^(?P=fence)\n|^<!-- run\n(?P<hidden>.*?)^-->\n|^<!-- picture (?P<picture>\S+) -->\n",
    re.MULTILINE | re.DOTALL,
)
OUTPUT = re.compile(r"\n<!-- output -->\n.*?<!-- /output -->\n", re.DOTALL)
HASH = re.compile(r"\n<!-- cells (\w+) -->\n\Z")
TITLE = re.compile(r"^#+ (.+)$", re.MULTILINE)
#: What differs from run to run.
PASSING = re.compile(r"^.*: done in [\d.]+ s\n?|^[^\n]*\r(?=.)", re.MULTILINE)
#: Longest output [lines].
LONGEST = 60


def bare(text: str) -> str:
    """Return a page without outputs and hash."""
    return HASH.sub("\n", OUTPUT.sub("", text))


def digest(text: str) -> str:
    """Return the hash of a page's cells."""
    cells = "\0".join(found[0] for found in CELL.finditer(bare(text)))
    return hashlib.sha256(cells.encode()).hexdigest()[:16] if cells else ""


def up_to_date(page: Path) -> bool:
    """Return whether a page's outputs are of the cells that it has."""
    text = page.read_text(encoding="utf-8")
    kept = HASH.search(text)
    return (kept[1] if kept else "") == digest(_with_scripts(page, text))


def pages() -> list[Path]:
    """Return all pages that are written by hand."""
    return sorted(
        p for p in DOCS.rglob("*.md") if p.relative_to(DOCS).parts[0] not in ("reference", "gallery")
    )


def _with_scripts(page: Path, text: str) -> str:
    """Return a page with the lines of scripts as they are now."""

    def lines(found: re.Match[str]) -> str:
        if not (found["words"] or "").startswith("from="):
            return found[0]
        name, *ends = shlex.split(found["words"].removeprefix("from="))
        script = (page.parent / name).read_text(encoding="utf-8")
        if ends:
            begin = script.rindex("\n", 0, script.index(ends[0])) + 1
            last = script.index(ends[1], begin)
            end = script.rindex("\n", 0, last) if ends[2:] == ["before"] else script.index("\n", last)
            script = textwrap.dedent(script[begin:end]).rstrip("\n") + "\n"
        return f"{found['fence']}{found['language']} {found['words']}\n{script}{found['fence']}\n"

    return CELL.sub(lines, text)


class Page:
    """A page that is being run."""

    def __init__(self, path: Path) -> None:
        self.name = "-".join(path.relative_to(DOCS).with_suffix("").parts)
        self.module = types.ModuleType("__main__")
        self.up = "../" * (len(path.relative_to(DOCS).parts) - 1)
        self.pictures, self.title = 0, ""

    def output(self, cell: re.Match[str]) -> str:
        """Run a cell, and return its output as Markdown."""
        words = (cell["words"] or "").split()
        if cell["picture"]:
            return self.kept(sorted(Path().glob(cell["picture"]))[0])
        if cell["hidden"]:
            said, pictures = self.python(cell["hidden"], [])
            return "\n\n".join([said.strip("\n"), *pictures]).strip("\n")
        if words[0].startswith("file="):
            Path(words[0].removeprefix("file=")).write_text(cell["code"], encoding="utf-8")
        if words[0] != "run":
            return ""
        run = self.shell if cell["language"] == "sh" else self.python
        said, pictures = run(cell["code"], words)
        said = PASSING.sub("", said.replace(f"{Path.cwd()}/", "")).strip("\n")
        if "silent" in words:
            return ""
        lines = said.splitlines()
        if len(lines) > LONGEST:
            lines = [*lines[:LONGEST], f"... {len(lines) - LONGEST} further lines"]
        text = "\n".join(line.rstrip() for line in lines)
        fence = "`" * (3 if "```" not in text else 4)
        return "\n\n".join([*([f"{fence}text\n{text}\n{fence}"] if text else []), *pictures])

    def shell(self, code: str, words: list[str]) -> tuple[str, list[str]]:
        """Run commands; return what they print."""
        done = subprocess.run(
            ["bash", "-e", "-c", code],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
        )
        if (done.returncode != 0) != ("fails" in words):
            raise SystemExit(f"{self.name}: status {done.returncode} of\n{code}\n{done.stdout}")
        return done.stdout, []

    def python(self, code: str, words: list[str]) -> tuple[str, list[str]]:
        """Run Python; return what it prints with its last value, and its pictures."""
        import matplotlib.pyplot as plt
        from matplotlib.figure import Figure

        tree = ast.parse(code)
        last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
        names, value, pictures = vars(self.module), None, []
        said = io.StringIO()
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said), warnings.catch_warnings():
            warnings.showwarning = lambda message, kind, *_, **__: print(f"{kind.__name__}: {message}")
            try:
                exec(compile(tree, "cell", "exec"), names)
                if last:
                    value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
                if "fails" in words:
                    raise SystemExit(f"{self.name}: no error in\n{code}")
            except Exception as error:
                if "fails" not in words:
                    raise SystemExit(f"{self.name}: {traceback.format_exc()}\nin\n{code}") from None
                print(f"{type(error).__name__}: {error}")
            if value is not None and not code.rstrip().endswith(";"):
                if hasattr(value, "frames") and hasattr(value, "save"):
                    pictures.append(self.animation(value))
                elif not isinstance(value, Figure):
                    print(repr(value))
        figures = [plt.figure(number) for number in plt.get_fignums()]
        figures += [value] if isinstance(value, Figure) and value not in figures else []
        for figure in figures:
            place = Path(tempfile.mkdtemp()) / "figure.png"
            figure.savefig(place, dpi=110, bbox_inches="tight")
            pictures.append(self.kept(place))
        plt.close("all")
        return said.getvalue(), pictures

    def kept(self, picture: Path) -> str:
        """Keep a picture beside the pages, small, and return its Markdown."""
        from generate.keep import keep

        self.pictures += 1
        place = OUTPUTS / f"{self.name}-{self.pictures}.png"
        keep(picture, place)
        return self.shown(place)

    def animation(self, made: Any) -> str:
        """Keep an animation as a small GIF."""
        from PIL import Image

        self.pictures += 1
        place = OUTPUTS / f"{self.name}-{self.pictures}.gif"
        whole = Path(tempfile.mkdtemp()) / "run.gif"
        type(made)(made.motion, made.model, made.speed, 8.0, made.trail, made.forces).save(whole)
        with Image.open(whole) as images:
            frames = []
            for k in range(images.n_frames):
                images.seek(k)
                frames.append(images.convert("RGB").resize((420, 360)).quantize(32))
        frames[0].save(place, save_all=True, append_images=frames[1:], duration=125, loop=0, optimize=True)
        return self.shown(place)

    def shown(self, place: Path) -> str:
        """Return the Markdown of a picture."""
        return f"![{self.title}]({self.up}outputs/{place.name})"


def run(path: Path) -> None:
    """Run a page in the present folder, and write its outputs into it; its prose may change meanwhile."""
    page, text = Page(path), bare(_with_scripts(path, path.read_text(encoding="utf-8")))
    sys.modules["__main__"] = page.module
    for old in [*OUTPUTS.glob(f"{page.name}-[0-9]*.png"), *OUTPUTS.glob(f"{page.name}-[0-9]*.gif")]:
        old.unlink()
    outputs = []
    for cell in CELL.finditer(text):
        page.title = ([page.name, *TITLE.findall(text[: cell.start()])])[-1]
        outputs.append(page.output(cell))
    now = bare(_with_scripts(path, path.read_text(encoding="utf-8")))
    if digest(now) != digest(text):
        raise SystemExit(f"{path}: its cells were changed while they ran")
    parts, at = [], 0
    for cell, output in zip(CELL.finditer(now), outputs, strict=True):
        end = cell.end()
        folded = re.match(r"\n*</details>\n", now[end:])
        end += folded.end() if folded else 0
        parts.append(now[at:end])
        if output:
            parts.append(f"\n<!-- output -->\n{output}\n<!-- /output -->\n")
        at = end
    whole = "".join([*parts, now[at:]]).rstrip("\n")
    mark = digest(whole + "\n")
    path.write_text(whole + (f"\n\n<!-- cells {mark} -->\n" if mark else "\n"), encoding="utf-8")


def _apart(path: Path) -> str:
    """Run a page in a process and a folder of its own; return what went wrong."""
    bin_first = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    search = os.pathsep.join(str(p) for p in (DOCS, DOCS.parent))
    own = {"PATH": bin_first, "PYTHONPATH": f"{search}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    own |= {"COLUMNS": "110", "NO_COLOR": "1", "MPLBACKEND": "agg"}
    with tempfile.TemporaryDirectory() as folder:
        script = path.with_suffix(".py")
        if script.exists():
            shutil.copy(script, folder)
        done = subprocess.run(
            [sys.executable, "-m", "generate.cells", "--one", str(path)],
            cwd=folder, env=os.environ | own, capture_output=True, text=True, check=False,
        )  # fmt: skip
    return done.stdout + done.stderr if done.returncode else ""


def main(words: list[str]) -> int:
    """Run the pages whose cells have changed, or those named, or all; ``--check`` only lists them."""
    if words[:1] == ["--one"]:
        run(Path(words[1]))
        return 0
    named = [Path(word).resolve() for word in words if not word.startswith("--")]
    wanted = named or [p for p in pages() if "--all" in words or not up_to_date(p)]
    if "--check" in words:
        print(
            *(f"{p.relative_to(DOCS.parent)}: its cells have changed: make pages" for p in wanted), sep="\n"
        )
        return bool(wanted)
    OUTPUTS.mkdir(exist_ok=True)
    with ThreadPoolExecutor(2) as pool:
        wrong = list(pool.map(_apart, wanted))
    for path, said in zip(wanted, wrong, strict=True):
        print(f"{path.relative_to(DOCS.parent)}: {said or 'written'}")
    return any(wrong)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
