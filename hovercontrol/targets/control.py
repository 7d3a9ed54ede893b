"""A Block as one python-control system, with names, units' order and parameters that are checked."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike, NDArray

from hovercontrol.core.block import Block
from hovercontrol.core.delays import pade as approximated
from hovercontrol.core.delays import registers
from hovercontrol.core.functions import numpy_functions
from hovercontrol.errors import InputError, did_you_mean
from hovercontrol.io.tables import positive
from hovercontrol.targets import friction_slopes
from hovercontrol.targets.library import Point, Solver
from hovercontrol.targets.linear import point_values, state_space
from hovercontrol.targets.points import points

Array = NDArray[np.float64]

#: How a hybrid Block is integrated from step to step.
_STEPS = Solver("dormand-prince", 0.0, 1e-6, 1e-9)


class _Params(dict[str, float]):
    """A parameter dict that knows it came from a system, not from a user's hand.

    ``control.interconnect`` copies each subsystem's ``params`` and adds those of all others; a key of another
    system is then no mistake. The type survives that copy, so the two cases can be distinguished.
    """

    def copy(self) -> _Params:
        return _Params(self)


class BlockSystem(control.NonlinearIOSystem):
    """The python-control system of a Block; made by ``block.to_control()``.

    Where a large Block is evaluated often, machine code takes over from Python, with the same numbers to
    rounding (:mod:`.points` says when); without a C compiler Python goes on.

    Parameter keys are those of the Block (``plant.yaw_coulomb``). An unknown key is refused; inside a
    ``control.interconnect``, where every subsystem is handed the keys of all, a key that begins with this
    Block's name must be one of its own.

    Parameters
    ----------
    block : Block
    name : str, optional
        System name (default: the Block's).
    """

    def __init__(self, block: Block, name: str | None = None) -> None:
        self.block = block
        super().__init__(
            self._updates,
            self._outputs,
            params=_Params(block.default_parameters),
            inputs=[s.name for s in block.inputs],
            outputs=[s.name for s in block.outputs],
            states=[s.name for s in block.states],
            name=name or block.name,
            dt=block.period,
        )
        self._prepare()

    def _prepare(self) -> None:
        self._points = points(self.block)
        self._native: tuple[Point, Point] | None = None
        self._values = self.block.parameter_values()

    def __getstate__(self) -> dict[str, Any]:
        left_out = ("_points", "_native")
        return {k: v for k, v in self.__dict__.items() if k not in left_out}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        values = self._values
        self._prepare()
        self._values = values

    def _update_params(self, params: Mapping[str, float] | None) -> None:
        own = self.params
        given = params or {}
        foreign = [key for key in given if key not in own]
        for key in foreign:
            pushed = isinstance(params, _Params)
            if not pushed or key.split(".")[0] in {k.split(".")[0] for k in own}:
                hint = did_you_mean(key, own)
                raise InputError(f"system {self.name!r}: unknown parameter {key!r}{hint}")
        current = {key: given.get(key, value) for key, value in own.items()}
        self._current_params = current
        self._values = self.block.parameter_values(current)
        self._native = None

    def _updates(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        return numpy_functions(self.block).derivatives(t, x, u, self._own(params))

    def _outputs(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        return numpy_functions(self.block).outputs(t, x, u, self._own(params))

    def _own(self, params: Mapping[str, float]) -> dict[str, float]:
        return {key: params[key] for key in self.params if key in params}

    # What python-control calls at every point; the two methods above, without looking up parameters again.
    def _rhs(self, t: float, x: Any, u: Any) -> Array:
        native, u = self._native or self._look_for_native(), self._commanded(u)
        if native:
            return native[0](t, x, u)
        return self._points.python("derivatives", t, x, u, self._values)

    def _out(self, t: float, x: Any, u: Any) -> Array:
        native, u = self._native or self._look_for_native(), self._commanded(u)
        if native:
            return native[1](t, x, u)
        return self._points.python("outputs", t, x, u, self._values)

    def _commanded(self, u: Any) -> Any:
        """Return inputs; ``control.find_operating_point`` hands on None where its user gives none."""
        return np.zeros(self.ninputs) if u is None else u

    def _look_for_native(self) -> tuple[Point, Point] | None:
        self._native = self._points.native(self._values)
        return self._native

    def linearize(
        self,
        x0: Any,
        u0: ArrayLike | None = None,
        t: float = 0.0,
        params: Mapping[str, float] | None = None,
        *,
        copy_names: bool = True,
        **kwargs: Any,
    ) -> control.StateSpace:
        """Return the linearisation at a point, from the exact Jacobians.

        Parameters
        ----------
        x0 : array_like, shape (n_states,), scalar for all states, or control.OperatingPoint
        u0 : array_like, shape (n_inputs,), or scalar for all inputs; default the operating point's, or 0
        t : float, optional
            Time [s].
        params : mapping, optional
            Parameter values by key.
        copy_names : bool, optional
            Whether the names of signals and the system are kept; if not, python-control numbers them.
        **kwargs
            As for :func:`control.linearize`: ``name``, ``inputs``, ``outputs``, ``states``.

        Raises
        ------
        InputError
            If a number of values or a key is wrong, or a value is not finite.

        Warns
        -----
        SmoothedFrictionWarning
            If a pole is the slope of smoothed dry friction.
        """
        if isinstance(x0, control.OperatingPoint):
            x0, u0 = x0.states, x0.inputs if u0 is None else u0
        x = point_values(x0, self.nstates, "state", self.block.name)
        u = point_values(u0, self.ninputs, "input", self.block.name)
        kwargs.pop("eps", None)  # a step for finite differences: nothing is left to choose
        self._update_params(params)
        point = friction_slopes.Point(t, x, u, self._current_params)
        matrices = friction_slopes.linear_matrices(self.block, point)
        friction_slopes.warn_of_smoothing(self.block, matrices[0], point)
        if copy_names:
            labels = {"inputs": self.input_labels, "outputs": self.output_labels, "states": self.state_labels}
            kwargs = {"name": f"{self.name}$linearized", **labels, **kwargs}
        return state_space(matrices, self.dt, **kwargs)


class HybridSystem(BlockSystem):
    """The python-control system of a hybrid Block: a discrete-time system, exact between its steps.

    From one step to the next the Block is integrated, and its ticks are taken when they are due, also those
    between two steps. Inputs hold from step to step.

    Parameters
    ----------
    block : Block
    name : str, optional
    step : float
        [s]
    """

    def __init__(self, block: Block, name: str | None, step: float) -> None:
        super().__init__(block, name)
        self.dt = step

    def _prepare(self) -> None:
        self._compiled = self.block.compile()
        self._values = self.block.parameter_values()

    def __getstate__(self) -> dict[str, Any]:
        return {k: v for k, v in self.__dict__.items() if k != "_compiled"}

    def _advanced(self, t: float, until: float, x: Any, u: Any) -> Array:
        given = np.ravel(self._commanded(u))
        return self._compiled.advance_values(t, until, np.ravel(x), given, self._values, _STEPS)

    def _rhs(self, t: float, x: Any, u: Any) -> Array:
        return self._advanced(t, t + self.dt, x, u)

    def _out(self, t: float, x: Any, u: Any) -> Array:
        outputs = self._compiled.point_values("outputs", self._values)
        return outputs(t, self._advanced(t, t, x, u), np.ravel(self._commanded(u)))

    def _updates(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        self._update_params(params)
        return self._rhs(t, x, u)

    def _outputs(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        self._update_params(params)
        return self._out(t, x, u)

    def linearize(self, *args: Any, **kwargs: Any) -> control.StateSpace:
        """Refuse: what ticks has no derivative; raises :class:`InputError`."""
        self.block.need_continuous("linearisation", hybrid=False)
        raise AssertionError


def to_control(
    block: Block, name: str | None = None, *, step: float | None = None, pade: int | None = None
) -> BlockSystem:
    """Return a Block as one :class:`control.NonlinearIOSystem`.

    Parameters
    ----------
    block : Block
    name : str, optional
        System name (default: the Block's).
    step : float, optional
        Of a hybrid Block, which becomes a discrete-time system of that step [s] (default: the shortest of its
        periods). Its ticks are on time whatever the step. Of a Block whose inputs act late, without `pade`:
        the same, with shift registers of that step, of which each delay is a multiple.
    pade : int, optional
        Order of Pade's fraction for the delays of inputs that act late
        (:func:`hovercontrol.core.delays.pade`).

    Raises
    ------
    InputError
        If the step is not positive, or the Block is not hybrid and has none; if inputs act late and neither
        `step` nor `pade` says what to make of it, or none does and `pade` is given.

    Examples
    --------
    >>> from hovercontrol.core.signals import Signal
    >>> v, k = Signal("v", "m/s"), Signal("k", "1/s", start=2.0)
    >>> system = to_control(Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
    >>> float(system.dynamics(0, [1.0], [], params={"decay.k": 3.0})[0])
    -3.0
    """
    if pade is not None:
        if not block.delays:
            raise InputError(f"block {block.name!r}: no input acts late, found pade={pade!r}")
        block = approximated(block, pade)
    elif block.delays:
        if step is None:
            late = next(iter(block.delays))
            raise InputError(
                block.where(
                    f"python-control has no continuous delay, and the input {late!r} acts late: "
                    "to_control(pade=4) approximates it; to_control(step=h) is exact where inputs change at "
                    "multiples of h alone and each delay is one"
                )
            )
        block = registers(block, positive(f"block {block.name!r}: step", step))
    if not block.ticks:
        if step is not None:
            raise InputError(f"block {block.name!r}: only a hybrid block is stepped, found step={step!r}")
        return BlockSystem(block, name)
    step = min(tick.period for tick in block.ticks) if step is None else step
    if not 0 < step < np.inf:
        raise InputError(f"block {block.name!r}: step must be positive, found {step!r}")
    return HybridSystem(block, name, step)
