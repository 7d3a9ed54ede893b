"""C for a board: compiled with the strictest warnings, run beside the Block."""

import shutil
import subprocess

import numpy as np
import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from tests.identification.monitor.cart import PERIOD, cart_monitor, log

STRICT = [
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wshadow",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Werror",
    "-pedantic",
]


@pytest.mark.skipif(not shutil.which("cc"), reason="no C compiler (cc) on this machine")
def test_a_monitor_on_a_board_says_what_the_block_says(tmp_path):
    block, run = cart_monitor(), log(40.0, drag=0.3)
    files = block.to_c(tmp_path / "board")
    sources = [str(f) for f in files if f.suffix == ".c"]
    for source in sources:  # a board has no operating system
        hosted = [] if source.endswith("main.c") else ["-ffreestanding"]
        subprocess.run(["cc", *STRICT, *hosted, "-O1", "-c", source, "-o", f"{source}.o"], check=True)
    program = str(tmp_path / "program")
    subprocess.run(["cc", *(f"{source}.o" for source in sources), "-lm", "-o", program], check=True)
    columns = {
        s.name: run.columns.get(s.name, 0 * run.time + s.name.startswith("fresh")) for s in block.inputs
    }
    rows = np.stack(list(columns.values()), axis=1)
    text = "\n".join(" ".join(map(repr, row)) for row in rows.tolist())
    said = subprocess.run([program], input=text, capture_output=True, text=True, check=True).stdout
    found = np.array([[float(v) for v in line.split()] for line in said.splitlines()])
    other = block.compile().simulate(PERIOD * np.arange(len(rows)), columns).outputs
    assert found[:, 0].max() == 1.0
    assert found == pytest.approx(np.asarray(other).T, rel=1e-6, abs=1e-9)


def test_what_is_not_sampled_is_refused_in_one_line(tmp_path):
    v = Signal("v", "m/s")
    with pytest.raises(InputError, match="C for a board needs a sampled Block of one period"):
        Block("still", [v], [], [v], [], {"v": 0 * v.symbol}).to_c(tmp_path)
