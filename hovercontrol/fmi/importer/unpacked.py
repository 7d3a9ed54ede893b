"""FMUs checked and unpacked into a temporary folder, before their code runs."""

from __future__ import annotations

import hashlib
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import fmpy  # type: ignore[import-untyped]

from hovercontrol.base.errors import InputError
from hovercontrol.fmi.importer.archive import LIMITS, Archive, check_xml, open_archive
from hovercontrol.fmi.importer.interface import Interface, Kind
from hovercontrol.fmi.importer.reading import read_interface

DESCRIPTION = "modelDescription.xml"


class Unpacked:
    """The temporary folder of an FMU; removed when the last system that runs from it is closed."""

    def __init__(self) -> None:
        self.folder = Path(tempfile.mkdtemp(prefix="hovercontrol-fmu-"))
        self._users = 1

    def hold(self) -> None:
        """Count one more user."""
        self._users += 1

    def release(self) -> None:
        """Count one user less."""
        self._users -= 1
        if self._users == 0:
            shutil.rmtree(self.folder, ignore_errors=True)


@dataclass(frozen=True)
class Source:
    """An FMU that has been checked and unpacked."""

    path: Path
    digest: str
    interface: Interface
    unpacked: Unpacked


def open_source(
    path: Path, kind: Kind | None = None, strict: bool = True, params: Mapping[str, float] | None = None
) -> Source:
    """Check and unpack an FMU without running its code; of `params` its structural parameters are set."""
    with open_archive(path) as archive:
        unpacked = Unpacked()
        try:
            interface = _described(archive, unpacked.folder, kind, strict, params)
            binaries = _binaries(archive, interface)
            archive.unpack(unpacked.folder, lambda name: name.startswith((binaries, "resources/")))
            (unpacked.folder / "resources").mkdir(exist_ok=True)
            return Source(path, digest_of(path), interface, unpacked)
        except BaseException:
            unpacked.release()
            raise


def describe(path: Path, folder: Path, kind: Kind | None = None, strict: bool = True) -> Interface:
    """Return an FMU's interface; ``modelDescription.xml`` is written to the folder, and nothing else."""
    with open_archive(path) as archive:
        return _described(archive, folder, kind, strict)


def _described(
    archive: Archive,
    folder: Path,
    kind: Kind | None,
    strict: bool,
    params: Mapping[str, float] | None = None,
) -> Interface:
    data = archive.read(DESCRIPTION, LIMITS.description)
    header = check_xml(data, f"{archive.path}: {DESCRIPTION}")
    (folder / DESCRIPTION).write_bytes(data)
    return read_interface(folder / DESCRIPTION, header, str(archive.path), kind, strict, params)


def _binaries(archive: Archive, interface: Interface) -> str:
    """Return the folder of this platform's binary; raise if there is none."""
    platform = fmpy.platform if interface.fmi == 2 else fmpy.platform_tuple
    folder = f"binaries/{platform}/"
    if f"{folder}{interface.identifier}{fmpy.sharedLibraryExtension}" not in archive.names:
        parts = (name.split("/") for name in archive.names)
        others = sorted({p[1] for p in parts if p[0] == "binaries" and len(p) > 2})
        has = f"those it has: {', '.join(others)}" if others else "it has no binary"
        wanted = f"{folder}{interface.identifier}{fmpy.sharedLibraryExtension}"
        raise InputError(f"{archive.path} has no binary for this platform ({wanted}); {has}")
    return folder


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
