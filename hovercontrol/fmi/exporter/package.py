"""The .fmu file: a ZIP archive whose bytes depend only on its content."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping

#: The oldest date that a ZIP archive can say.
_DATE = (1980, 1, 1, 0, 0, 0)


def packed(files: Mapping[str, bytes]) -> bytes:
    """Return a ZIP archive of files by path, the same bytes for the same files.

    ``modelDescription.xml`` comes first, the others in the order of their names.
    """
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        for path in sorted(files, key=lambda path: (path != "modelDescription.xml", path)):
            entry = zipfile.ZipInfo(path, date_time=_DATE)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3  # Unix, wherever it is written
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, files[path])
    return stream.getvalue()
