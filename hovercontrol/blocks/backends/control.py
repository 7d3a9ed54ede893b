"""The python-control system of a Block, with the Block's names and order and with checked parameters.

:mod:`.to_control` creates it. Discrete-time systems of integrated Blocks are in :mod:`.discrete`.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from hovercontrol.base.arrays import Array
from hovercontrol.base.caller import caller_level
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.backends import friction_slopes
from hovercontrol.blocks.backends.library import Point
from hovercontrol.blocks.backends.linear import point_values, sampled_names, state_space
from hovercontrol.blocks.backends.points import points
from hovercontrol.blocks.block import Block


class _Params(dict[str, float]):
    """A parameter dict of a system; its type distinguishes it from a user's dict.

    ``control.interconnect`` copies each subsystem's ``params`` and adds those of all others, so a key of
    another system is not an error there. The type survives that copy, so the two cases can be distinguished.
    The union of the ``params`` of all subsystems overrides those of each; it leaves out a key for which two
    systems have different values, so that each keeps its own.

    Parameters
    ----------
    values : mapping
    apart : frozenset of str, optional
        Keys left out.
    """

    def __init__(self, values: Mapping[str, float], apart: frozenset[str] = frozenset()) -> None:
        super().__init__(values)
        self.apart = apart

    def copy(self) -> _Params:
        return _Params(self, self.apart)

    def __ror__(self, other: Any) -> Any:
        return _Params({**other, **self}, self.apart)

    def __or__(self, other: Any) -> Any:
        if not isinstance(other, _Params):
            return _Params({**self, **other}, self.apart)
        known = self.apart | other.apart
        differ = {key for key in self.keys() & other.keys() if self[key] != other[key]} - known
        if differ:
            key = min(differ)
            warnings.warn(
                f"two systems have the parameter {key!r}, with the values {self[key]:g} and {other[key]:g}: "
                "each keeps its own; a value given for the interconnection reaches both. Keys follow the "
                f"name of a system: block.to_control('other_{key.split('.')[0]}')",
                stacklevel=caller_level(),
            )
        apart = known | differ
        return _Params({k: v for k, v in {**self, **other}.items() if k not in apart}, apart)


class BlockSystem(control.NonlinearIOSystem):
    """The python-control system of a Block, from ``block.to_control()``.

    If a large Block is evaluated often, machine code replaces Python (:mod:`.points` describes when); results
    agree to rounding. Without a C compiler Python continues.

    Parameter keys are those of the Block with the system's name in place of the Block's: ``yaw_coulomb`` of
    ``block.to_control("left")`` is ``left.yaw_coulomb``. They follow when the system is copied or renamed; a
    suffix that python-control adds (``left$sampled``) is no part of them. An unknown key raises an error.
    Inside a ``control.interconnect``, where every subsystem gets the keys of all others, only a key that
    begins with this system's name must be one of its own. Of two systems of one name python-control numbers
    the states of the second (``left_1_u``) but not the system: ``left.yaw_coulomb`` reaches both, and
    ``left_1.yaw_coulomb`` none. Give each its name: ``block.to_control("right")``.

    Parameters
    ----------
    name : str, optional
        System name (default: the Block's).
    """

    def __init__(self, block: Block, name: str | None = None) -> None:
        self.block = block
        self._keys: dict[str, str] = {}
        self.name = name or block.name
        super().__init__(
            self._updates,
            None if self._outputs_are_states() else self._outputs,
            params=_Params({key: block.default_parameters[own] for key, own in self._keys.items()}),
            inputs=[s.name for s in block.inputs],
            outputs=[s.name for s in block.outputs],
            states=[s.name for s in block.states],
            name=self.name,
            dt=block.period,
        )
        self._prepare()

    @property
    def name(self) -> str:
        """The system's name, also the first part of its parameters' keys."""
        return self._name

    @name.setter
    def name(self, name: str) -> None:
        own, stem = f"{self.block.name}.", name.partition("$")[0]
        before, self._name = self._keys, name
        #: the Block's key of each key of the system
        self._keys = {
            f"{stem}.{key.removeprefix(own)}" if key.startswith(own) else key: key
            for key in self.block.default_parameters
        }
        if "params" in vars(self):
            now = {key: new for new, key in self._keys.items()}
            params: dict[str, float] = vars(self)["params"]
            self.params = _Params({now.get(before.get(k, k), k): v for k, v in params.items()})

    @property
    def block_params(self) -> dict[str, float]:
        """The parameters by the Block's keys."""
        return self._by_block(self.params)

    def _by_block(self, params: Mapping[str, float]) -> dict[str, float]:
        found = {}
        for key, value in params.items():
            last_part = self.block.full_key(key) if "." not in key else key
            own = self._keys.get(key, last_part if last_part != key else "")
            if not own:
                check_known(key, self._keys, f"system {self.name!r}: unknown parameter {key!r}")
            found[own or key] = value
        return found

    def _outputs_are_states(self) -> bool:
        """Whether the outputs are the states in order, which python-control's state feedback checks."""
        given = self.block.output_expressions.values()
        return bool(self.block.outputs) and list(given) == [s.symbol for s in self.block.states]

    def _prepare(self) -> None:
        self._points = points(self.block)
        self._native: tuple[Point, Point] | None = None
        self._values = self.block.parameter_values()
        # The parameters checked last: own, given, and whether an interconnection gave them.
        self._seen: tuple[dict[str, float], dict[str, float], bool] | None = None
        self._direct: tuple[dict[str, float], tuple[float, ...]] | None = None

    def __getstate__(self) -> dict[str, Any]:
        left_out = ("_points", "_native", "_seen", "_direct")
        return {k: v for k, v in self.__dict__.items() if k not in left_out}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        values = self._values
        self._prepare()
        self._values = values

    def _update_params(self, params: Mapping[str, float] | None) -> None:
        # Called by every `dynamics` and `output`: a comparison takes 0.3 us, a check 5 us per parameter.
        own, given, pushed = self.params, params or {}, isinstance(params, _Params)
        try:
            if self._seen == (own, given, pushed):
                return
        except ValueError:  # an array among the values; the check below raises
            pass
        ours = {key.split(".")[0] for key in self._keys}
        foreign = {key for key in given if pushed and key not in own and key.split(".")[0] not in ours}
        self._current_params = self._by_block({**own, **{k: v for k, v in given.items() if k not in foreign}})
        self._values = self.block.parameter_values(self._current_params)
        self._native = None
        self._seen = dict(own), dict(given), pushed

    # The system's `updfcn` and `outfcn`, called with all parameters (by phase planes, for example).
    def _updates(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        return self._points.python("derivatives", t, x, self._commanded(u), self._own(params))

    def _outputs(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        return self._points.python("outputs", t, x, self._commanded(u), self._own(params))

    def _own(self, params: Mapping[str, float]) -> tuple[float, ...]:
        if self._direct is None or self._direct[0] != params:
            own = self._by_block({key: params[key] for key in self.params if key in params})
            self._direct = dict(params), self.block.parameter_values(own, bounded=False)
        return self._direct[1]

    # Called by python-control at every point; like the two methods above, without looking up parameters.
    def _rhs(self, t: float, x: Any, u: Any) -> Array:
        native, u = self._native or self._look_for_native(), self._commanded(u)
        if native:
            return native[0](t, x, u)
        return self._points.python("derivatives", t, x, u, self._values)

    def _out(self, t: float, x: Any, u: Any) -> Array:
        native, u = self._native or self._look_for_native(), self._commanded(u)
        if native:  # python-control passes one number as the states of a static system
            return native[1](t, x if self.nstates else (), u)
        return self._points.python("outputs", t, x, u, self._values)

    def _commanded(self, u: Any) -> Any:
        """Return the inputs, 0 for None, which ``control.find_operating_point`` passes if none are given."""
        return np.zeros(self.ninputs) if u is None else u

    def _look_for_native(self) -> tuple[Point, Point] | None:
        self._native = self._points.native(self._values)
        return self._native

    def _derivative_matrices(self, t: float, x: Array, u: Array) -> list[Array]:
        point = friction_slopes.Point(t, x, u, self._current_params)
        matrices = friction_slopes.linear_matrices(self.block, point)
        friction_slopes.warn_of_smoothing(self.block, matrices[0], point)
        return matrices

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
        """Return the linearisation at a point, from exact Jacobians.

        Parameters
        ----------
        x0 : array_like, shape (n_states,), scalar for all states, or control.OperatingPoint
        u0 : array_like, shape (n_inputs,), or scalar for all inputs; default the operating point's, or 0
        t : float, optional
            Time [s].
        params : mapping, optional
            Parameter values by key.
        copy_names : bool, optional
            Whether the signals and the system keep their names; if not, python-control numbers them.
        **kwargs
            As for :func:`control.linearize`: ``name``, ``inputs``, ``outputs``, ``states``.

        Raises
        ------
        InputError
            If the number of values is wrong, a key is unknown, or a value is not finite.

        Warns
        -----
        SmoothedFrictionWarning
            If a pole is due to the slope of smoothed dry friction.
        """
        if isinstance(x0, control.OperatingPoint):
            x0, u0 = x0.states, x0.inputs if u0 is None else u0
        x = point_values(x0, self.nstates, "state", self.block.name)
        u = point_values(u0, self.ninputs, "input", self.block.name)
        kwargs.pop("eps", None)  # step for finite differences, not needed here
        self._update_params(params)
        matrices = self._derivative_matrices(t, x, u)
        if copy_names:
            labels = {"inputs": self.input_labels, "outputs": self.output_labels, "states": self.state_labels}
            kwargs = {"name": f"{self.name}$linearized", **labels, **kwargs}
        return state_space(matrices, self.dt, **kwargs)

    def sample(
        self,
        Ts: float,
        method: str = "zoh",
        alpha: float | None = None,
        prewarp_frequency: float | None = None,
        name: str | None = None,
        copy_names: bool = True,
        **kwargs: Any,
    ) -> BlockSystem:
        """Return the discrete-time system with inputs held over each step; ``control.c2d`` calls this.

        It is the system of ``block.to_control(step=Ts)`` with this system's parameters.

        Parameters
        ----------
        Ts : float
            Sampling period [s].
        method : {"zoh"}, optional
            Other methods (``"tustin"``) apply to linear systems only.
        alpha, prewarp_frequency : None
            Parameters of other methods.
        name : str, optional
            Name of the system (default: this system's name with ``$sampled``).
        copy_names : bool, optional
            Whether the signals and the system keep their names; if not, python-control numbers them.
        **kwargs
            As for :func:`control.sample_system`: ``inputs``, ``outputs``, ``states``.

        Raises
        ------
        InputError
            If the period is not positive, the method is not "zoh", or the system is already discrete.
        """
        if method != "zoh" or alpha is not None or prewarp_frequency is not None:
            raise InputError(
                f"system {self.name!r}: a nonlinear system is sampled with method='zoh' alone, found "
                f"{method!r}: linearise it first"
            )
        if self.dt:
            raise InputError(f"system {self.name!r}: already discrete, with a step of {self.dt:g} s")
        sampled = self.block.to_control(self.name, step=Ts)
        sampled.params = self.params.copy()
        sampled._update_params(None)
        sampled.update_names(**sampled_names(self, name, copy_names, kwargs))
        return sampled
