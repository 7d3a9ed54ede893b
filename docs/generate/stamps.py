"""What a part of the reference was made of: parts whose sources have not changed are kept."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

ROOT = Path(__file__).parents[2]


def stamp(folders: Iterable[str]) -> str:
    """Return the hash of these files, and of all files below these folders, of the checkout."""
    found = hashlib.sha256()
    for folder in folders:
        place = ROOT / folder
        for path in [place] if place.is_file() else sorted(place.rglob("*")):
            if path.is_file() and path.suffix in (
                ".py",
                ".toml",
                ".c",
                ".h",
                ".csv",
                ".md",
                ".json",
                ".png",
                ".txt",
            ):
                found.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return found.hexdigest()


def generators(module: ModuleType) -> list[str]:
    """Return the files of a module of this package and of all others that it uses, from the checkout's root."""
    found, left = {module.__name__: module}, [module]
    while left:
        for value in vars(left.pop()).values():
            name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", "")
            if str(name).startswith("generate.") and name not in found:
                found[name] = sys.modules[name]
                left.append(sys.modules[name])
    files = (Path(str(used.__file__)).resolve() for used in found.values())
    return sorted(str(file.relative_to(ROOT)) for file in files)


def kept(place: Path, now: str) -> str:
    """Return what a part said when it was made, if it was made of the same sources; else nothing."""
    old, _, said = place.read_text(encoding="utf-8").partition("\n") if place.exists() else ("", "", "")
    return said if old == now else ""
