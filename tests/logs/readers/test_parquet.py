"""Parquet files: where pages have checksums, a changed bit is one line, not another number."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.logs import Log, read_log

LOG = Log("a", np.arange(400) / 50, {name: np.sqrt(np.arange(400.0) + k) for k, name in enumerate("uvr")})


@pytest.mark.parametrize("by", ["pyarrow", "ours"])
def test_a_changed_bit_is_never_read_as_another_number(tmp_path, by):
    file, options = tmp_path / "a.parquet", {"compression": "none", "use_dictionary": False}
    if by == "ours":
        LOG.save(file)
    else:
        table = pa.table({"time": LOG.time, **LOG.columns})
        pa.parquet.write_table(table, file, write_page_checksum=True, **options)
    sound, refused = file.read_bytes(), 0
    assert np.array_equal(read_log(file)["v"], LOG["v"])
    for at in range(100, len(sound) - 3000, 401):  # in the columns' pages
        file.write_bytes(sound[:at] + bytes([sound[at] ^ 4]) + sound[at + 1 :])
        try:
            log = read_log(file)
        except InputError as error:
            refused += "\n" not in str(error) and str(file) in str(error)
        else:
            assert all(np.array_equal(log[name], LOG[name]) for name in "uvr")
    assert refused > 15
