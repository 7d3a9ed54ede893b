"""Python API: every public function and class, by package."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
import sys
from collections import defaultdict
from pathlib import Path
from pprint import pformat
from types import ModuleType
from typing import Any

import hovercontrol
from generate.pages import code, first_sentence, table, toctree, write

#: Values longer than these signs are not shown.
LONGEST = 1500


def public_modules() -> list[ModuleType]:
    """Return the modules that say what is public in them, the package itself first."""
    names = [m.name for m in pkgutil.walk_packages(hovercontrol.__path__, "hovercontrol.")]
    found = [importlib.import_module(name) for name in sorted(names) if not name.endswith("__main__")]
    return [hovercontrol, *(m for m in found if getattr(m, "__all__", None))]


def public_names() -> dict[str, tuple[str, Any]]:
    """Return every public name, ``module.name``, with the page it has: a thing has one, where it is first met."""
    first: dict[int, str] = {}
    found = {}
    for module in public_modules():
        for name in module.__all__:
            thing = getattr(module, name)
            whole = f"{module.__name__}.{name}"
            shared = inspect.isclass(thing) or inspect.isfunction(thing)
            found[whole] = (first.setdefault(id(thing), whole) if shared else whole, thing)
    return found


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each public name and one for each module."""
    every = public_names()
    by_module: dict[str, list[str]] = defaultdict(list)
    for whole, (page, thing) in every.items():
        by_module[whole.rpartition(".")[0]].append(whole)
        if page == whole:
            _page(whole, thing, into / "api" / f"{whole}.md")
    for module, names in by_module.items():
        rows = []
        for whole in names:
            page, thing = every[whole]
            rows.append((f"[`{whole.rpartition('.')[2]}`]({page}.md)", _says(thing)))
        own = [whole for whole in names if every[whole][0] == whole]
        write(
            into / "api" / f"{module}.md",
            f"# {module}",
            first_sentence(importlib.import_module(module).__doc__).replace("``", "`"),
            table(("name", "what it is"), rows),
            toctree(own),
        )
    rows = [
        (
            f"[`{m}`](api/{m}.md)",
            first_sentence(importlib.import_module(m).__doc__).replace("``", "`"),
            len(n),
        )
        for m, n in by_module.items()
    ]
    write(
        into / "api.md",
        "# Python API",
        "All public modules. Most scripts need only `import hovercontrol as hc` ([its names by task](../names.md)).",
        table(("module", "what it is", "names"), rows),
        toctree(f"api/{m}" for m in by_module),
    )
    return "api", f"{len(every)} public names"


def _says(thing: Any) -> str:
    if not (inspect.isclass(thing) or callable(thing)):
        return f"`{type(thing).__name__}`"
    text = first_sentence(inspect.getdoc(thing)).replace("``", "`")
    return (
        text.replace(":class:", "")
        .replace(":func:", "")
        .replace(":data:", "")
        .replace(":mod:", "")
        .replace("~", "")
    )


def _page(whole: str, thing: Any, path: Path) -> None:
    name = whole.rpartition(".")[2]
    if not (inspect.isclass(thing) or inspect.isfunction(thing)):
        write(
            path, f"# {name}", f"`{whole}`, of type `{type(thing).__name__}`.", _comment(whole), _value(thing)
        )
        return
    kind = "class" if inspect.isclass(thing) else "function"
    options = [":members:", ":show-inheritance:"] if kind == "class" else []
    lines = [f".. auto{kind}:: {whole}", *(f"   {o}" for o in options)]
    write(path, f"# {name}", "```{eval-rst}\n" + "\n".join(lines) + "\n```")


def _comment(whole: str) -> str:
    """Return the comment of a constant, which stands where it is made: in a module of the package or of one below."""
    owner, _, name = whole.rpartition(".")
    thing = getattr(sys.modules[owner], name)
    for label, module in sorted(sys.modules.items()):
        if label.startswith("hovercontrol") and vars(module).get(name) is thing:
            text = Path(module.__file__ or "").read_text(encoding="utf-8")
            found = re.search(rf"((?:^#: .*\n)+){name}\b", text, flags=re.MULTILINE)
            if found:
                return " ".join(line.removeprefix("#: ") for line in found[1].splitlines()).replace("``", "`")
    return ""


def _value(thing: Any) -> str:
    text = pformat(thing, width=100, compact=True)
    return code(text, "python") if len(text) < LONGEST and " at 0x" not in text else ""
