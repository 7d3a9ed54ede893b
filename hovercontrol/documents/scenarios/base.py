"""A scenario derived from another one: ``[scenario] base = "table2"``."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from hovercontrol.base.errors import InputError
from hovercontrol.base.tables import read_toml, text


def with_base(
    content: dict[str, Any], path: Path, find: Callable[[str, Path], Path], seen: tuple[Path, ...] = ()
) -> dict[str, Any]:
    """Return a scenario file's content merged with its bases.

    Keys of a section that the file lacks come from the base. Lists of sections (``[[phase]]``,
    ``[[metric]]``) and sections with their own ``kind`` replace those of the base.

    Parameters
    ----------
    content : dict
        Of the file.
    path : Path
        Of the file.
    find : callable
        Returns the path of a scenario by its name, or of a file beside this one.

    Raises
    ------
    InputError
        If a base does not exist, or scenarios are bases of each other.
    """
    head = content.get("scenario")
    if not isinstance(head, dict) or "base" not in head:
        return content
    own = {**content, "scenario": {key: value for key, value in head.items() if key != "base"}}
    there = find(text("scenario.base", head["base"]), path)
    if there in seen:
        raise InputError(f"scenario.base: {head['base']!r} has this scenario as its own base")
    below = with_base(read_toml(there), there, find, (*seen, path, there))
    return {key: _over(below.get(key), own.get(key)) for key in {**below, **own}}


def _over(below: Any, own: Any) -> Any:
    if own is None:
        return below
    if not (isinstance(below, Mapping) and isinstance(own, Mapping)) or "kind" in own:
        return own
    return {**below, **own}
