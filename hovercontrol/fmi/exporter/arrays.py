"""Arrays of FMI 3: variables whose names differ in their index alone, as one variable with dimensions.

``P[0,0]``, ``P[0,1]``, ..., ``P[2,2]`` become ``P`` of 3 x 3 if all elements are there, row by row, else a
vector of those that are there (the upper triangle of a covariance matrix, a diagonal). FMI 3
gives an array one unit, one nominal size and one description; those of the elements, and their names, are an
annotation, which :mod:`hovercontrol.fmi.importer.interface` reads.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hovercontrol.fmi.exporter.variables import Variable

#: Type of the annotation with the names, units and descriptions of an array's elements.
ELEMENTS = "org.hovercontrol.elements"


@dataclass(frozen=True)
class Array:
    """Variables that FMI 3 lists as one.

    Attributes
    ----------
    name : str
        The elements' name without the index.
    elements : tuple of Variable
        In order; their value references follow each other. The first is the array's.
    shape : tuple of int
    """

    name: str
    elements: tuple[Variable, ...]
    shape: tuple[int, ...]

    @property
    def reference(self) -> int:
        """The value reference of the array, that of its first element."""
        return self.elements[0].reference


def arrays_of(variables: Sequence[Variable]) -> tuple[Array, ...]:
    """Return the arrays among variables, by value reference; a state's derivatives follow the state.

    Examples
    --------
    >>> from hovercontrol.fmi.exporter.variables import Interface
    >>> from hovercontrol.documents.scenarios import load_scenario
    >>> from hovercontrol.documents.scenarios.runner import loop_parts
    >>> estimator = loop_parts(load_scenario("table1"))["estimator"]
    >>> [(a.name, a.shape) for a in arrays_of(Interface(estimator).variables)][:3]
    [('xhat', (11,)), ('P', (66,)), ('der(xhat)', (11,))]
    """
    taken = {v.name for v in variables}
    groups: dict[tuple[str, str], list[Variable]] = {}
    for v in variables:
        stem, index = _parted(v)
        if index and stem not in taken:
            groups.setdefault((v.kind, stem), []).append(v)
    stems = [stem for _, stem in groups]
    found = [
        Array(stem, tuple(group), _shape([_parted(v)[1] for v in group]))
        for (_, stem), group in groups.items()
        if stems.count(stem) == 1 and _alike(group)
    ]
    states = {a.reference: a for a in found if a.elements[0].kind == "state"}
    derived = {a.elements[0].derivative_of: a for a in found if a.elements[0].kind == "derivative"}
    # Both of an array of states and its derivatives are arrays, or none; held states have no derivatives.
    moving = {v.derivative_of for v in variables if v.kind == "derivative"}
    lonely = {
        a
        for a in found
        if (a.reference in states and a.reference in moving and a.reference not in derived)
        or (a.elements[0].kind == "derivative" and a.elements[0].derivative_of not in states)
    }
    return tuple(a for a in found if a not in lonely)


def _parted(v: Variable) -> tuple[str, tuple[int, ...]]:
    """Return a name without its index, and the index: ``der(P[0,1])`` gives ``der(P)`` and (0, 1)."""
    stem, bracket, rest = v.name.partition("[")
    index, closed, end = rest.partition("]")
    numbers = index.split(",")
    if not bracket or not closed or end.strip(")") or not all(n.isdecimal() for n in numbers):
        return v.name, ()
    return stem + end, tuple(map(int, numbers))


def _alike(group: Sequence[Variable]) -> bool:
    """Whether variables can be one array: FMI 3 gives it one causality, variability and pair of bounds."""
    same = {
        (v.causality, v.variability, v.initial, v.lower, v.upper, v.reinit, v.start is None) for v in group
    }
    return (
        len(group) > 1
        and len(same) == 1
        and all(b.reference == a.reference + 1 for a, b in itertools.pairwise(group))
        and all((b.derivative_of or 0) == (a.derivative_of or -1) + 1 for a, b in itertools.pairwise(group))
    )


def _shape(indices: Sequence[tuple[int, ...]]) -> tuple[int, ...]:
    """Return the dimensions if the indices fill a rectangle row by row, else the number of elements."""
    if len({len(index) for index in indices}) == 1:
        ranges = [sorted(set(places)) for places in zip(*indices, strict=True)]
        if list(itertools.product(*ranges)) == list(indices):
            return tuple(len(r) for r in ranges)
    return (len(indices),)


def as_one(array: Array) -> Variable:
    """Return an array as a variable: what its elements have in common."""
    first = array.elements[0]
    names = [v.name for v in array.elements]
    listed = names if len(names) <= 3 else [*names[:2], "...", names[-1]]
    return replace(
        first,
        name=array.name,
        unit=first.unit if len({v.unit for v in array.elements}) == 1 else None,
        description=f"elements {', '.join(listed)}",
        nominal=first.nominal if len({v.nominal for v in array.elements}) == 1 else 1.0,
    )
