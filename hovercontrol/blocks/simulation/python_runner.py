"""Stepwise simulation of a Block with plain Python floats."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.functions import call_scalar, numpy_functions
from hovercontrol.blocks.simulation.reasons import StoppedError
from hovercontrol.blocks.simulation.runner import INPUT_NOT_FINITE, BlockRunner, Inputs
from hovercontrol.blocks.simulation.ticking import Running
from hovercontrol.blocks.switching import switching_times


class PythonEngine:
    """Steps a Block with plain Python floats; dry friction is smoothed over its width.

    Parameters
    ----------
    block : Block
        Without delays.
    time : float
        Initial time [s].
    """

    kind = "python"

    def __init__(
        self,
        block: Block,
        time: float,
        states: Sequence[float],
        inputs: Sequence[float],
        params: Sequence[float],
        rtol: float,
        atol: float,
    ) -> None:
        self._block, self._params = block, tuple(params)
        self._run = Running(block, time, states, inputs, self._params, rtol, atol)
        self._pair = numpy_functions(block).scalar_pair("outputs")
        self._unpack = struct.Struct(f"{len(inputs)}d").unpack
        self._find_switches()
        self.y = np.empty(len(block.outputs))
        self._look()

    def step(self, until: float, sent: bytes) -> int:
        """Set the inputs and integrate to the time `until` [s]; see :class:`Engine`."""
        inputs = self._unpack(sent)
        if not all(map(math.isfinite, inputs)):
            return INPUT_NOT_FINITE
        run = self._run
        run.set_inputs(inputs)
        try:
            for switch in self._switches:
                if run.time < switch < until:
                    run.advance(switch)
            run.advance(until)
        except StoppedError as end:
            return end.status
        finally:
            self._look()
        return 0

    def jump(self, states: Mapping[int, float], params: Sequence[float]) -> int:
        """Set states and parameters now; see :class:`Engine`."""
        self._params = tuple(params)
        self._run.change(states, self._params)
        self._find_switches()
        self._look()
        return 0

    def time(self) -> float:
        """Return the time reached [s]."""
        return self._run.time

    def states(self) -> Array:
        """Return the states."""
        return np.array(self._run.state, dtype=float)

    def save(self) -> Any:
        """Return the complete state of the engine, for :meth:`load`."""
        return self._run.save()

    def load(self, saved: Any) -> None:
        """Restore what :meth:`save` returned."""
        sizes = [
            len(part) for part in self._run.save()[3:7]
        ]  # times of the next ticks, states, inputs, parameters
        found = [len(part) for part in saved[3:7]]
        if found != sizes:
            raise ValueError(f"expected {sizes} numbers, found {found}")
        self._run.load(saved)
        self._params = tuple(saved[-2])
        self._find_switches()
        self._look()

    def _find_switches(self) -> None:
        values = dict(zip(self._block.default_parameters, self._params, strict=True))
        self._switches = switching_times(self._block, values)

    def _look(self) -> None:
        run = self._run
        self.y[:] = call_scalar(self._pair, run.time, run.state, run.inputs, self._params)


def start_block(
    block: Block,
    x0: ArrayLike | Mapping[str, float] | None = None,
    params: Mapping[str, float] | None = None,
    *,
    inputs: Inputs | None = None,
    time: float = 0.0,
    rtol: float = 1e-6,
    atol: float = 1e-9,
) -> BlockRunner:
    """Start a Block with plain floats; arguments as for :meth:`hovercontrol.blocks.block.Block.start`."""
    whole = block.in_continuous_time
    plain = undelayed(whole)

    def make(
        begin: float, states: Sequence[float], held: Sequence[float], values: Sequence[float]
    ) -> PythonEngine:
        return PythonEngine(plain, begin, states, held, values, rtol, atol)

    return BlockRunner(whole, make, x0, params, inputs, time)
