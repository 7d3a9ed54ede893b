"""What python-control systems made from FMUs share: the FMU's signals by name, parameters by key."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Self

import control
import numpy as np
from numpy.typing import NDArray

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.control import _Params
from hovercontrol.fmi.importer.interface import Interface, Variable, units_and_descriptions
from hovercontrol.fmi.importer.unpacked import Source
from hovercontrol.fmi.importer.values import InputCheck, own_parameters, parameter_key

Array = NDArray[np.float64]
Parameters = tuple[float | None, ...]


class Loaded(control.NonlinearIOSystem):
    """An FMU as a python-control system; each kind gives ``_rhs`` and ``_out`` and sets ``_end``.

    Parameters
    ----------
    states : sequence of Variable or of str
        The FMU's states, or the names of others.
    """

    _end: Any

    def __init__(
        self,
        source: Source,
        name: str,
        params: Mapping[str, float] | None,
        dt: float,
        states: Sequence[Variable] | list[str],
    ) -> None:
        self.path, self._source, self._prefix = source.path, source, name
        interface = source.interface
        # By position: each parameter's key, its variable and its value in the FMU (NaN: not known).
        elements = [(x, v, s) for v in interface.parameters for x, s in zip(v.labels, v.start, strict=True)]
        self._keys = {parameter_key(name, label): (v, start) for label, v, start in elements}
        if len(self._keys) < len(elements):  # the FMU has both "k" and "plant.k"
            self._keys = {f"{name}.{label}": (v, start) for label, v, start in elements}
        defaults = {key: value for key, (_, value) in self._keys.items() if value == value}
        defaults |= self._checked(params or {}, pushed=False)
        own = [v for v in states if isinstance(v, Variable)]
        signals = [*interface.inputs, *interface.outputs, *own]
        inputs, outputs, labels = (
            [x for v in group for x in v.labels] for group in (interface.inputs, interface.outputs, own)
        )
        labels = labels or [s for s in states if isinstance(s, str)]
        sizes = {"inputs": len(inputs), "outputs": len(outputs), "states": len(labels)}
        super().__init__(self._updates, self._results, params=_Params(defaults), name=name, dt=dt, **sizes)
        # Set past python-control's check, which takes no dots.
        self.input_index = {label: i for i, label in enumerate(inputs)}
        self.output_index = {label: i for i, label in enumerate(outputs)}
        self.state_index = {label: i for i, label in enumerate(labels)}
        units, descriptions = units_and_descriptions(signals)
        of_keys, texts_of_keys = units_and_descriptions(interface.parameters, self._keys)
        self.units, self.descriptions = units | of_keys, descriptions | texts_of_keys
        self._input_check = InputCheck(interface.inputs)
        self._values = self.values_in_order(defaults)

    @property
    def interface(self) -> Interface:
        """The FMU's interface, from its model description."""
        return self._source.interface

    def close(self) -> None:
        """Free the FMU's instance and its temporary folder; may be called twice."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def _label(self) -> str:
        return f"FMU {self.name!r}"

    def _alive(self) -> None:
        if not self._end.alive:
            raise InputError(f"{self._label} is closed")

    def _checked(self, params: Mapping[str, float], pushed: bool) -> dict[str, float]:
        return own_parameters(params, self._keys, self._prefix, self.interface, pushed)

    def values_in_order(self, values: Mapping[str, float]) -> Parameters:
        """Return the values in the FMU's order, None for values that the FMU already has."""
        found = ((values.get(key, start), start) for key, (_, start) in self._keys.items())
        return tuple(None if value == start or value != value else float(value) for value, start in found)

    def _update_params(self, params: Mapping[str, float] | None) -> None:
        given = self._checked(params or {}, pushed=isinstance(params, _Params))
        self._current_params = {**self._checked(self.params, pushed=False), **given}
        self._values = self.values_in_order(self._current_params)

    def _updates(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        with self._with(params):
            values: Array = self._rhs(t, x, u)
        return values

    def _results(self, t: float, x: Any, u: Any, params: Mapping[str, float]) -> Array:
        with self._with(params):
            values: Array = self._out(t, x, u)
        return values

    @contextlib.contextmanager
    def _with(self, params: Mapping[str, float]) -> Iterator[None]:
        before = self._values
        self._values = self.values_in_order({**self.params, **self._checked(params, pushed=True)})
        try:
            yield
        finally:
            self._values = before
