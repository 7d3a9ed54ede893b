"""The ModelStructure of a corrected FMU: what outputs and derivatives depend on at the same instant."""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement

import sympy as sp

from hovercontrol.fmi.corrected.inner_fmu import InnerFmu
from hovercontrol.fmi.corrected.joined import Joined

#: References of the knowns of an unknown; None: it may depend on all.
Knowns = frozenset[int] | None

#: Elements of outputs, derivatives and initial unknowns, by version of FMI.
TAGS = {
    2: ("Outputs/Unknown", "Derivatives/Unknown", "InitialUnknowns/Unknown"),
    3: ("Output", "ContinuousStateDerivative", "InitialUnknown"),
}


class KnownsOf:
    """What unknowns depend on at the same instant."""

    def __init__(self, inner: InnerFmu, joined: Joined, first: int) -> None:
        self._given, self._joined, block = inner, joined, joined.block
        self._driven = {v.reference: k for k, v in enumerate(joined.driven)}
        self._declared = self._read()
        moving = {s.symbol: frozenset([first + k]) for k, s in enumerate(block.states[: block.n_continuous])}
        held = {s.symbol: frozenset[int]() for s in block.states[block.n_continuous :]}
        n = len(block.states) + block.n_continuous
        tunable = {
            p.symbol: frozenset([first + n + k] if inner.version == 3 else [])
            for k, p in enumerate(block.parameters)
        }
        self._symbols: dict[sp.Basic, Knowns] = {**moving, **held, **tunable}
        free = [v.reference for v in inner.variables if v.element.get("causality") == "independent"]
        self._time = frozenset(free[:1])
        states = {s.reference for s, _ in inner.derivatives()}
        for k, v in enumerate(joined.driven):
            self._symbols[sp.Symbol(f"given_{k}", real=True)] = frozenset([v.reference])
        for k, v in enumerate(joined.sources):
            simple = (
                v.element.get("causality") in ("input", "parameter", "independent") or v.reference in states
            )
            of = frozenset([v.reference]) if simple else self._declared.get(v.reference)
            self._symbols[sp.Symbol(f"source_{k}", real=True)] = self.inner(of)

    def _read(self) -> dict[int, Knowns]:
        inner, found = self._given, {}
        tags = (
            ("Outputs/Unknown", "Derivatives/Unknown")
            if inner.version == 2
            else ("Output", "ContinuousStateDerivative")
        )
        for tag in tags:
            for u in inner.root.findall(f"ModelStructure/{tag}"):
                found[self.reference(u)] = self.listed(u)
        return found

    def reference(self, unknown: Element) -> int:
        """Return the value reference of an unknown of the ModelStructure."""
        if self._given.version == 2:
            return self._given.variables[int(unknown.get("index", "0")) - 1].reference
        return int(unknown.get("valueReference", "0"))

    def listed(self, unknown: Element) -> Knowns:
        """Return what the given FMU says that an unknown depends on."""
        text = unknown.get("dependencies")
        if text is None:
            return None
        numbers = [int(word) for word in text.split()]
        if self._given.version == 2:
            numbers = [self._given.variables[i - 1].reference for i in numbers]
        return frozenset(numbers)

    def inner(self, of: Knowns) -> Knowns:
        """Return the knowns of something of the inner FMU: its driven inputs are results of the Block."""
        if of is None:
            return None
        parts = [
            self.output(f"driven_{self._driven[r]}") if r in self._driven else frozenset([r]) for r in of
        ]
        return _union(parts)

    def output(self, name: str) -> Knowns:
        """Return the knowns of an output of the Block."""
        return self.expression(self._joined.block.output_expressions[name])

    def expression(self, e: sp.Basic) -> Knowns:
        """Return the knowns of an expression of the Block."""
        symbols = self._joined.block.expand(e).free_symbols
        return _union([self._symbols.get(s, self._time) for s in symbols])


def _union(parts: Iterable[Knowns]) -> Knowns:
    found: frozenset[int] = frozenset()
    for part in parts:
        if part is None:
            return None
        found |= part
    return found


def write_structure(
    inner: InnerFmu, joined: Joined, knowns: KnownsOf, first: int, renamed: Mapping[int, int]
) -> None:
    """Write the dependencies of all unknowns; add those of the Block."""
    structure = inner.root.find("ModelStructure")
    assert structure is not None
    block, two = joined.block, inner.version == 2
    listed = {v.reference: k for k, v in reversed(list(enumerate(inner.variables, 1)))}
    n, moving = len(block.states), block.n_continuous
    for k in range(n + moving + len(block.parameters) + len(renamed)):
        listed[first + k] = len(inner.variables) + k + 1

    def write(u: Element, reference: int, of: Knowns) -> None:
        u.set("index" if two else "valueReference", str(listed[reference] if two else reference))
        u.attrib.pop("dependenciesKind", None)
        u.attrib.pop("dependencies", None)
        if of is not None:
            numbers = sorted({listed[r] for r in of} if two else of)
            u.set("dependencies", " ".join(map(str, numbers)))

    tags = TAGS[inner.version]
    measured = {v.reference: k for k, v in enumerate(joined.measured)}
    for u in structure.findall(tags[0]):
        r = knowns.reference(u)
        of = knowns.output(f"measured_{measured[r]}") if r in measured else knowns.inner(knowns.listed(u))
        write(u, renamed.get(r, r), of)
    added: dict[int, list[Knowns]] = {}
    for k, place in enumerate(joined.added):
        added.setdefault(place, []).append(knowns.output(f"added_{k}"))
    for place, u in enumerate(structure.findall(tags[1])):
        write(u, knowns.reference(u), _union([knowns.inner(knowns.listed(u)), *added.get(place, [])]))
    for u in structure.findall(tags[2]):
        write(u, knowns.reference(u), None)
    for u in structure.findall("EventIndicator"):  # of FMI 3
        write(u, knowns.reference(u), knowns.inner(knowns.listed(u)))
    parts = {tag: copy.copy(structure.findall(tag)) for tag in tags}
    slopes: dict[int, Knowns] = {}
    if inner.exchange is not None:
        own = [block.derivatives[s.name] for s in block.states[:moving]]
        slopes = {first + n + k: knowns.expression(e) for k, e in enumerate(own)}
    for r, of in slopes.items():
        write(_appended(structure, tags[1], parts), r, of)
    for r in (*slopes, *renamed.values()):
        write(_appended(structure, tags[2], parts), r, None)


def _appended(structure: Element, tag: str, parts: dict[str, list[Element]]) -> Element:
    """Append an unknown to its list; lists have a fixed order."""
    order = list(parts)
    if "/" in tag:
        outer, inner = tag.split("/")
        parent = structure.find(outer)
        if parent is None:
            parent = Element(outer)
            names = [o.split("/")[0] for o in order]
            before = [e for e in structure if names.index(e.tag) < names.index(outer)]
            structure.insert(len(before), parent)
        return SubElement(parent, inner)
    before = [e for e in structure if e.tag in order[: order.index(tag) + 1]]
    element = Element(tag)
    structure.insert(list(structure).index(before[-1]) + 1 if before else 0, element)
    return element
