"""Whether a corrected FMU gives partial derivatives, by the chain rule of the given FMU's and the Block's."""

from __future__ import annotations

from hovercontrol.blocks.signals import time
from hovercontrol.fmi.corrected.inner_fmu import InnerFmu, Variable
from hovercontrol.fmi.corrected.joined import Joined

#: What the description says of them, in FMI 2 and FMI 3.
PARTIALS = ("providesDirectionalDerivative", "providesDirectionalDerivatives", "providesAdjointDerivatives")


def differentiable(inner: InnerFmu, joined: Joined) -> bool:
    """Return whether a corrected FMU gives partial derivatives.

    The given FMU has Model Exchange and gives its own, what the Block reads is one of its knowns or unknowns,
    and the Block does not depend on time itself: time is a known of FMI 3.
    """
    offered = [inner.part.get(word) for word in PARTIALS[:2]]
    if inner.exchange is None or not {"true", "1"} & set(offered):
        return False
    if any(time in e.free_symbols for _, e in joined.block.all_expressions()):
        return False
    unknowns = _unknowns(inner)
    known = known_sources(inner, joined)
    return all(k or v.reference in unknowns for k, v in zip(known, joined.sources, strict=True))


def known_sources(inner: InnerFmu, joined: Joined) -> list[bool]:
    """Return of each variable that the Block reads whether it is a known, or constant between events."""
    states = {s.reference for s, _ in inner.derivatives()}
    return [_is_known(v, states) for v in joined.sources]


def _is_known(v: Variable, states: set[int]) -> bool:
    if v.reference in states or v.element.get("causality") in ("input", "parameter", "independent"):
        return True
    return v.element.get("variability") in ("constant", "discrete")


def _unknowns(inner: InnerFmu) -> set[int]:
    """Return the value references of outputs and derivatives."""
    outputs = {v.reference for v in inner.variables if v.element.get("causality") == "output"}
    return outputs | {d.reference for _, d in inner.derivatives()}
