"""Checkpoints of a sweep: a folder of Parquet files from which the same sweep continues.

A file's name ends in the digest of its bytes, so that a damaged file is detected and its runs are repeated.
"""

from __future__ import annotations

import hashlib
import io
import json
import re
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder, readable, reason, write_quietly
from hovercontrol.blocks.backends.sweep import FIGURES, SweepResult
from hovercontrol.blocks.simulation.reasons import REASONS

if TYPE_CHECKING:
    from hovercontrol.blocks.backends.compiled import CompiledBlock

_KEY = b"hovercontrol.sweep"
_NAME = re.compile(r"runs-\d{9}-\d{9}-([0-9a-f]{32})\.parquet")


def fingerprint(ready: CompiledBlock, *rest: Any) -> str:
    """Return the identifier of a sweep: a digest of its Block, times, values and options."""
    parts = [ready.block.content_hash, ready.friction, *rest]
    return hashlib.sha256(json.dumps(parts, default=_plain).encode()).hexdigest()


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


class Checkpoint:
    """The folder of one sweep.

    Parameters
    ----------
    folder : Path
        Created if it does not exist.
    digest : str
        The sweep's :func:`fingerprint`.

    Raises
    ------
    InputError
        If the folder cannot be written.
    """

    def __init__(self, folder: Path, digest: str) -> None:
        check_folder(folder)
        self.folder, self.digest = folder, digest

    def load(self, result: SweepResult) -> None:
        """Copy the results in the folder into `result`; other runs are left unchanged.

        A damaged file is removed with a warning; its runs must be computed again.

        Raises
        ------
        InputError
            If a file cannot be read, is not a file of a sweep, or belongs to another sweep.
        """
        import pyarrow.parquet

        for path in sorted(self.folder.glob("*.parquet")):
            content = _checked(path)
            if content is None:
                path.unlink(missing_ok=True)
                warnings.warn(f"{path}: damaged; its runs are computed again", stacklevel=2)
                continue
            table = pyarrow.parquet.read_table(io.BytesIO(content))
            if (table.schema.metadata or {}).get(_KEY) != self.digest.encode():
                raise InputError(
                    f"{path}: belongs to another sweep (other equations, values or options): take another "
                    "folder, or remove it"
                )
            runs = table["run"].to_numpy()
            result.status[runs] = [REASONS.index(reason) for reason in table["status"].to_pylist()]
            for k, output in enumerate(result.outputs):
                for figure in FIGURES:
                    getattr(result, figure)[runs, k] = table[f"{output}.{figure}"].to_numpy()
            for k, state in enumerate(result.states):
                result.states_final[runs, k] = table[f"{state}.end"].to_numpy()

    def add(self, result: SweepResult, part: slice) -> None:
        """Write one part of the runs of a result to the folder.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        import pyarrow.parquet

        table = result.to_table(part)
        table = table.replace_schema_metadata({_KEY: self.digest.encode()})
        stream = io.BytesIO()
        pyarrow.parquet.write_table(table, stream)
        content = stream.getvalue()
        path = self.folder / f"runs-{part.start:09d}-{part.stop:09d}-{_digest(content)}.parquet"
        write_quietly(path, lambda file: file.write_bytes(content))


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()[:32]


def _checked(path: Path) -> bytes | None:
    """Return the content of a checkpoint file, None if its digest does not match.

    Raises
    ------
    InputError
        If its name is not that of a checkpoint file, or it cannot be read.
    """
    named = _NAME.fullmatch(path.name)
    if named is None:
        raise InputError(f"{path}: not readable as Parquet of a sweep: expected runs-FROM-TO-DIGEST.parquet")
    try:
        content = readable(path, "results of a sweep").read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {reason(error)}") from None
    return content if _digest(content) == named[1] else None
