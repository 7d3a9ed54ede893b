"""Checkpoints of a sweep: a folder of Parquet files from which the same sweep continues."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from hovercontrol.errors import InputError
from hovercontrol.io.files import check_folder, write_quietly
from hovercontrol.simulation.reasons import REASONS
from hovercontrol.targets.sweep import FIGURES, SweepResult

if TYPE_CHECKING:
    from hovercontrol.targets.compiled import CompiledBlock

_KEY = b"hovercontrol.sweep"


def fingerprint(ready: CompiledBlock, *rest: Any) -> str:
    """Return what identifies a sweep: a digest of its Block, times, values and options."""
    parts = [ready.block.content_hash, ready.friction, *rest]
    return hashlib.sha256(json.dumps(parts, default=_plain).encode()).hexdigest()


def _plain(value: Any) -> Any:
    return np.asarray(value).tolist()


class Checkpoint:
    """The folder of one sweep.

    Parameters
    ----------
    folder : Path
        Made if it is not there.
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
        """Put in place what the folder holds; other runs are left as they are.

        Raises
        ------
        InputError
            If a file is not readable, or belongs to another sweep.
        """
        import pyarrow.parquet

        for path in sorted(self.folder.glob("*.parquet")):
            try:
                table = pyarrow.parquet.read_table(path)
            except (OSError, pyarrow.ArrowException) as error:
                raise InputError(f"{path}: not readable as Parquet: {error}") from None
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
        """Write some runs of a result.

        Raises
        ------
        InputError
            If they cannot be written.
        """
        import pyarrow.parquet

        table = result.to_table(part)
        table = table.replace_schema_metadata({_KEY: self.digest.encode()})
        path = self.folder / f"runs-{part.start:09d}-{part.stop:09d}.parquet"
        write_quietly(path, lambda file: pyarrow.parquet.write_table(table, file))
