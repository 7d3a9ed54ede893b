"""A system of FMUs as one python-control system."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import control

from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.backends.control import _Params
from hovercontrol.fmi.importer.interface import Interface
from hovercontrol.fmi.importer.unpacked import DESCRIPTION, describe
from hovercontrol.fmi.ssp.names import units_of
from hovercontrol.fmi.ssp.structure import Component, End, Map, Place, Structure, read_structure
from hovercontrol.fmi.ssp.wires import Wires

#: A signal of a part in python-control's way: system, label.
Signal = tuple[str, str]


class FmuSystems(control.InterconnectedSystem):
    """FMUs connected by a file; a parameter that none has is refused, where python-control skips it."""

    def _update_params(self, params: Mapping[str, float] | None) -> None:
        if not isinstance(params, _Params):  # not from another interconnection, with those of its systems
            parts = {part.name for part in self.syslist}
            for key in params or {}:
                if key.split(".")[0] not in parts:  # a part checks its own
                    check_known(key, self.params, f"system {self.name!r}: unknown parameter {key!r}")
        super()._update_params(params)


def load_ssp(path: Path, load: Callable[..., Any], **options: Any) -> control.InterconnectedSystem:
    """Return a system of FMUs as one python-control system; :func:`hovercontrol.fmi.load` calls this.

    Parameters
    ----------
    load : callable
        :func:`hovercontrol.fmi.load`.
    **options
        Its arguments for each FMU.

    Raises
    ------
    InputError
        If it is not a system of FMUs, a connection or a value does not fit, or an FMU cannot be loaded.
    """
    parts: dict[Place, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        structure = read_structure(path, Path(folder))
        described = {}
        for c in structure.components:
            c.kind = options["kind"] or c.kind
            described[c.place] = _described(c, structure, options["strict"])
        wires = Wires(str(path), structure, described)
        try:
            for c in structure.components:
                name = _distinct("_".join(c.place), [part.name for part in parts.values()])
                own = options | {"kind": c.kind, "name": name, "params": wires.parameters(c.place)}
                parts[c.place] = load(c.file, **own)
            return _Joined(path, structure, parts, wires).system()
        except BaseException:
            for part in parts.values():
                part.close()
            raise


def _described(component: Component, structure: Structure, strict: bool) -> Interface:
    """Return a component's interface; its unit definitions are added to those of the file that names it."""
    with tempfile.TemporaryDirectory() as folder:
        interface = describe(component.file, Path(folder), component.kind, strict)
        root = ElementTree.parse(Path(folder, DESCRIPTION)).getroot()
        structure.units[component.place] = {**dict(units_of(root)), **structure.units[component.place]}
        return interface


def _distinct(name: str, taken: Sequence[str]) -> str:
    """Return a name without dots that no other system has."""
    name = name.replace(".", "_")
    while name in taken:
        name += "_"
    return name


class _Joined:
    """The arguments of ``control.interconnect`` for a system."""

    def __init__(self, path: Path, structure: Structure, parts: Mapping[Place, Any], wires: Wires) -> None:
        self._path, self._structure, self._parts, self._wires = path, structure, parts, wires
        steps = sorted({part.dt for part in parts.values()})
        if len(steps) > 1:
            text = " and ".join(f"{step:g}" for step in steps)
            raise InputError(f"{path}: the FMUs have steps of {text} s; give one by step=")
        self._dt = steps[0] if steps else None
        self._extra: list[Any] = []  # constants, and maps that python-control's gains cannot express
        self._inner: list[Any] = []
        outer = structure.connectors.items()
        self._into: dict[str, list[Any]] = {
            end.name: [] for end, (kind, _) in outer if not end.place and kind == "input"
        }

    def system(self) -> control.InterconnectedSystem:
        """Return the parts, connected."""
        for place, part in self._parts.items():
            for v in part.interface.inputs:
                for k, label in enumerate(v.labels):
                    self._feed((part.name, label), self._source(*self._wires.origin(place, v, k)))
        outputs = self._outputs()
        if not outputs:
            warnings.warn(f"{self._path}: the system has no outputs", stacklevel=4)
        into = {name: ends for name, ends in self._into.items() if ends}
        joined = control.interconnect(
            [*self._parts.values(), *self._extra],
            name=self._path.stem.replace(".", "_"),
            connections=self._inner or False,
            inplist=list(into.values()),
            inputs=list(into),
            outlist=list(outputs.values()),
            outputs=list(outputs),
            check_unused=False,
        )
        joined.__class__ = FmuSystems
        return joined

    def _source(self, end: End | float, maps: Sequence[Map], k: int | None) -> Any:
        """Return (system, label, gain), the name of an outer input, or None for the constant 0.

        `k` is the element of an array, None of a scalar.
        """
        gain = 1.0
        for m in maps:
            gain *= m.factor
        plain = not any(m.offset or m.table for m in maps)
        if isinstance(end, float):
            for m in maps:
                end = m.of(end)
            value = end
            return (*self._block([], lambda _: value), 1.0) if value else None
        if not end.place:
            source: Any = end.name if k is None else f"{end.name}[{k + 1}]"
            if plain and gain == 1.0:
                return source
        else:
            part = self._parts[end.place]
            labels = [label for v in part.interface.outputs if end.name == v.name for label in v.labels]
            labels = labels or [end.name]
            k = k or 0
            if k >= len(labels):
                raise InputError(f"{self._path}: {end.text()} has {len(labels)} elements, its target more")
            source = (part.name, labels[k], gain)
            if plain:
                return source
            source = (part.name, labels[k], 1.0)

        def mapped(u: Any) -> float:
            value = float(u[0])
            for m in maps:
                value = m.of(value)
            return value

        name, label = self._block(["u"], mapped)
        self._feed((name, "u"), source)
        return name, label, 1.0

    def _block(self, inputs: list[str], function: Callable[[Any], float]) -> Signal:
        """Add a system without states and return its output."""
        name = _distinct("map", [s.name for s in (*self._parts.values(), *self._extra)])
        self._extra.append(
            control.nlsys(
                None,
                lambda _t, _x, u, _params: [function(u)],
                inputs=inputs,
                outputs=["y"],
                name=name,
                dt=self._dt,
            )
        )
        return name, "y"

    def _feed(self, target: Signal, source: Any) -> None:
        if isinstance(source, str):
            self._into.setdefault(source, []).append(target)
        elif source is not None:
            self._inner.append([target, source])

    def _outputs(self) -> dict[str, Any]:
        """Return the outputs: of the system or, where it has none, of its components."""
        found: dict[str, Any] = {}
        for end, (kind, _) in self._structure.connectors.items():
            if end.place or kind not in ("output", "local", "calculatedParameter"):
                continue
            origin, maps = self._wires.traced(end)
            if origin == end:
                warnings.warn(f"{self._path}: output {end.name!r} is connected to nothing", stacklevel=5)
                continue
            n = 1
            if isinstance(origin, End) and origin.place:
                of = [v for v in self._parts[origin.place].interface.outputs if v.name == origin.name]
                n = len(of[0].labels) if of else 1
            for k in range(n):
                source = self._source(origin, maps, None if n == 1 else k)
                if source is None or isinstance(source, str):  # a constant, or straight from an input
                    block = self._block(["u"], lambda u: float(u[0]))
                    self._feed((block[0], "u"), source)
                    source = (*block, 1.0)
                found[end.name if n == 1 else f"{end.name}[{k + 1}]"] = source
        if found:
            return found
        labels = [(part.name, label) for part in self._parts.values() for label in part.output_index]
        plain = [label for _, label in labels]
        return {
            label if plain.count(label) == 1 else f"{part}_{label}": (part, label) for part, label in labels
        }
