"""PX4's ULog, read by pyulog: one topic per message, ``vehicle_attitude/q[0]``, time in us since boot."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from hovercontrol.base.errors import InputError
from hovercontrol.logs.readers.tables import Table, Tables, faults, library

_CLOCK = "timestamp"


def ulog(file: Path) -> Tables:
    """Open a flight log; a second instance of a topic is named ``topic[1]``.

    Raises
    ------
    InputError
        If pyulog is missing, or the file is damaged or contains no topic.
    """
    core = library(file, "pyulog.core", "PX4 logs")
    with faults(file, "ULog"):
        log = core.ULog(str(file))
    tables = [_table(file, data) for data in log.data_list if _CLOCK in data.data]
    if not tables:
        raise InputError(f"{file}: a ULog without data")
    return Tables(file, tables)


def _table(file: Path, data: Any) -> Table:
    topic = data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"
    columns = {f"{topic}/{name}": np.asarray(values) for name, values in data.data.items()}
    clock = f"{topic}/{_CLOCK}"
    columns[clock] = columns[clock].astype(np.int64)
    return Table.of(file, topic, columns, clock, {clock: "us"})
