"""Linear systems of python-control, and the points about which it linearises."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import control
import numpy as np
from scipy.signal import cont2discrete

from hovercontrol.base.arrays import Array
from hovercontrol.base.errors import InputError


class StateSpaceWithoutInputs(control.StateSpace):
    """A linear system without inputs, from :func:`state_space`.

    ``control.StateSpace`` mistakes a matrix of shape (1, 0) for one of shape (0, 0) (python-control #1176)
    and then raises an error. So this system is created with one input, which is then removed. Linearisation
    and sampling, for which python-control creates another system, are done here in the same way.
    """

    def __init__(self, matrices: Sequence[Array], dt: float | None, **kwargs: Any) -> None:
        A, B, C, D = matrices
        without = kwargs.pop("inputs", [])
        with_one = (A, np.zeros((len(B), 1)), C, np.zeros((len(D), 1)))
        super().__init__(*with_one, dt, remove_useless_states=False, **kwargs)
        self.B, self.D = B, D
        self.set_inputs(without)

    def _again(self, A: Array, dt: float | None, **names: Any) -> StateSpaceWithoutInputs:
        return StateSpaceWithoutInputs([A, self.B, self.C, self.D], dt, **names)

    def linearize(
        self, x0: Any, u0: Any = None, t: float = 0, params: Any = None, eps: float = 1e-6,
        copy_names: bool = False, **kwargs: Any,
    ) -> control.StateSpace:  # fmt: skip
        """Return a copy: a linear system is its own linearisation at every point."""
        labels = {"outputs": self.output_labels, "states": self.state_labels} if copy_names else {}
        name = {"name": f"{self.name}$linearized"} if copy_names else {}
        return self._again(self.A, self.dt, **{**labels, **name, **kwargs})

    def sample(
        self, Ts: float, method: str = "zoh", alpha: float | None = None,
        prewarp_frequency: float | None = None, name: str | None = None, copy_names: bool = True,
        **kwargs: Any,
    ) -> control.StateSpace:  # fmt: skip
        """Return the discrete-time system; arguments as for :meth:`control.StateSpace.sample`."""
        if not self.isctime():
            raise ValueError("System must be continuous-time system")
        with_one = (self.A, np.zeros((self.nstates, 1)), self.C, np.zeros((self.noutputs, 1)))
        A, _, C, _, _ = cont2discrete(with_one, Ts, method, alpha)
        sampled = StateSpaceWithoutInputs([A, self.B, C, self.D], Ts)
        sampled.update_names(**sampled_names(self, name, copy_names, kwargs))
        return sampled


def sampled_names(
    system: control.InputOutputSystem, name: str | None, copy_names: bool, given: Mapping[str, Any]
) -> dict[str, Any]:
    """Return the names of a sampled system, as :func:`control.sample_system` chooses them.

    Parameters
    ----------
    system : control.InputOutputSystem
        Continuous.
    copy_names : bool
        Whether to keep the names of `system`.
    given : mapping
        ``inputs``, ``outputs``, ``states`` that replace these names.
    """
    if copy_names:
        default = control.config.defaults
        prefix, suffix = (default[f"iosys.sampled_system_name_{end}"] for end in ("prefix", "suffix"))
        inputs, outputs, states = system.input_labels, system.output_labels, system.state_labels
        labels = {"inputs": inputs, "outputs": outputs, "states": states}
        return {"name": name or f"{prefix}{system.name}{suffix}", **labels, **given}
    sizes = {"inputs": system.ninputs, "outputs": system.noutputs, "states": system.nstates}
    return {"name": name or control.InputOutputSystem().name, **sizes, **given}


def state_space(matrices: Sequence[Array], dt: float | None, **kwargs: Any) -> control.StateSpace:
    """Return the system ``A, B, C, D`` with all its states, also if it has no inputs.

    Parameters
    ----------
    dt : float or None
        As for :class:`control.StateSpace`.
    **kwargs
        Names, as for :class:`control.StateSpace`.

    Examples
    --------
    >>> import numpy as np
    >>> decay = state_space([-np.eye(1), np.zeros((1, 0)), np.eye(1), np.zeros((1, 0))], 0, outputs=["v"])
    >>> decay.B.shape, decay.D.shape, decay.output_labels
    ((1, 0), (1, 0), ['v'])
    """
    A, B, C, D = matrices
    if B.shape[1]:
        return control.StateSpace(A, B, C, D, dt, remove_useless_states=False, **kwargs)
    return StateSpaceWithoutInputs(matrices, dt, **kwargs)


def point_values(given: Any, n: int, kind: str, name: str) -> Array:
    """Return the n values of a point, interpreted as by python-control.

    Parameters
    ----------
    given : array_like or sequence of array_like or None
        None means 0; a scalar is used for every value; the parts of a sequence are joined.
    kind, name : str
        Kind of the values and name of the Block, for error messages.

    Raises
    ------
    InputError
        If the number of values is not n, or one is not a finite number.

    Examples
    --------
    >>> point_values([1.0, [2.0, 3.0]], 3, "state", "cart")
    array([1., 2., 3.])
    >>> point_values(None, 2, "input", "cart")
    array([0., 0.])
    """
    try:
        if isinstance(given, list | tuple):
            parts = [np.ravel(np.asarray(part, dtype=float)) for part in given]
            point = np.concatenate([np.zeros(0), *parts])
        elif np.ndim(given) == 0:
            point = np.full(n, 0.0 if given is None else given, dtype=float)
        else:
            point = np.asarray(given, dtype=float).ravel()
    except (TypeError, ValueError):
        raise InputError(f"block {name!r}: expected {n} {kind} values, found {given!r}") from None
    if point.size != n:
        raise InputError(f"block {name!r}: expected {n} {kind} values, found {point.size}")
    if not np.isfinite(point).all():
        k = int(np.argmin(np.isfinite(point)))
        raise InputError(f"block {name!r}: {kind} value {k} must be finite, found {point[k]}")
    return point
