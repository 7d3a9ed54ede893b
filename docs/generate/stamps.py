"""What a part of the reference was made of: parts whose sources have not changed are kept."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).parents[2]


def stamp(folders: Iterable[str]) -> str:
    """Return the hash of all files below these folders of the checkout."""
    found = hashlib.sha256()
    for folder in folders:
        for path in sorted((ROOT / folder).rglob("*")):
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


def kept(place: Path, now: str) -> str:
    """Return what a part said when it was made, if it was made of the same sources; else nothing."""
    old, _, said = place.read_text(encoding="utf-8").partition("\n") if place.exists() else ("", "", "")
    return said if old == now else ""
