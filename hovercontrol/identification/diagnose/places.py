"""Where an effect acts: in equations, in measured channels, or on commands."""

from __future__ import annotations

from types import SimpleNamespace

import sympy as sp

from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import time
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.base import quantity_of
from hovercontrol.identification.diagnose.laws.grammar import same_form
from hovercontrol.identification.diagnose.search.confirm import Rival
from hovercontrol.identification.engine.fit import Fit
from hovercontrol.identification.engine.subject import Subject, structure


def place_of(model: Subject, e: Effect) -> str:
    """Return where in the loop an effect acts and on what: an input, equations, a sensor, the clock.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_experiment")
    >>> for name in ("rudder_offset", "input_delay", "munk_moment", "gyro_bias", "time_offset"):
    ...     print(place_of(craft, hc.effect(name, 0.1)))
    actuator of rudder
    command of all inputs
    force in r'
    sensor of r
    clock of the log
    """
    place, block = e.place(), structure(model.with_effects([e]))
    if place == "clock":
        return "clock of the log"
    if place == "sensor":
        return f"sensor of {_acts_in(block, model, e).replace(' as measured', '')}"
    if place == "force":
        return f"force in {_acts_in(block, model, e)}"
    every = [s.name for s in block.inputs]
    changed = inputs_of(e, block, craft=model.is_craft)
    whole = len(changed) == len(every) > 1
    return f"{place} of {'all inputs' if whole else ', '.join(changed)}"


def place_of_rival(rival: Rival) -> str:
    """Return where in the loop a rival acts; an equivalent one is in no fitted model."""
    model = rival.fit.model
    fitted = rival.name in {e.name for e in model.effects}
    e = model.effect(rival.name) if fitted else model.effect_class(rival.name).small()
    return place_of(model, e)


def inputs_of(e: Effect, block: Block, *, craft: bool) -> list[str]:
    """Return the inputs of a Block that an effect changes.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("four_fan")
    >>> inputs_of(craft.effect_class("front_left_curve")(0.1), craft.plant(), craft=True)
    ['front_left']
    """
    sent = {s.name: s.symbol for s in block.inputs}
    rudder = sent.get("rudder", sp.Symbol("rudder", real=True))
    own = {n: symbol for n, symbol in sent.items() if not (craft and n == "rudder")}
    given = {"thrusts": dict(own), "inputs": dict(sent), "units": {s.name: s.unit for s in block.inputs}}
    way = SimpleNamespace(**given, rudder=rudder, time=time, delay=None)
    e.commands(e.symbols(block.name), way)
    if way.delay is not None:
        return list(sent)
    changed = {n for n in own if way.thrusts[n] != own[n]} | ({"rudder"} if way.rudder != rudder else set())
    return [n for n in sent if n in changed]


def of_one_form(model: Subject) -> list[tuple[str, ...]]:
    """Return the effects of a model that have one form in different equations, as a force off the centre has.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_simulation")
    >>> found = [craft.effect_class(n)(-0.5) for n in ("law_r__abs_v__v", "law_v__abs_v__v", "law_v__cub_v")]
    >>> of_one_form(craft.with_effects(found))
    [('law_r__abs_v__v', 'law_v__abs_v__v')]
    """
    block = structure(model)
    groups: list[tuple[sp.Expr, dict[str, str]]] = []
    for e in (e for e in model.effects if type(e).kind() == "force" and "value" in e.numbers):
        acting = _terms(block, model, e)
        if len(acting) != 1:
            continue
        ((equation, term),) = acting.items()
        alike = next((names for form, names in groups if same_form(form, term)), None)
        if alike is None:
            groups.append((term, {e.name: equation}))
        else:
            alike[e.name] = equation
    return [tuple(names) for _, names in groups if len(set(names.values())) > 1]


def _terms(block: Block, model: Subject, e: Effect) -> dict[str, sp.Expr]:
    """Return what an effect adds to the equations of a Block, per coefficient, by state."""
    own = block.parameter(e.parameter("value")).symbol
    slopes = {n: block.expand(block.derivatives[n]) for n in model.motion}
    return {n: sp.diff(slope, own) for n, slope in slopes.items() if own in slope.free_symbols}


def acts_in(fit: Fit, name: str) -> str:
    """Return where an effect acts, as text: equations, outputs, commands or clock."""
    return _acts_in(fit.problem.block, fit.problem.model, fit.problem.model.effect(name))


def _acts_in(block: Block, model: Subject, e: Effect) -> str:
    own = {block.parameter(e.parameter(k)).symbol for k in e.numbers}
    motion = model.motion
    rows = [
        f"{s.name}'"
        for s in block.states
        if s.name in motion and block.expand(block.derivatives[s.name]).free_symbols & own
    ]
    rows += [
        f"{quantity_of(o.name)[0]} as measured" if quantity_of(o.name)[1] else o.name
        for o in block.outputs
        if block.expand(block.output_expressions[o.name]).free_symbols & own
    ]
    return " ".join(rows) or (commands_of(block, own) if type(e).kind() == "input" else "the log's clock")


def commands_of(block: Block, own: set[sp.Symbol]) -> str:
    """Return the commands that pass through states whose equations contain given symbols; all if none does.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> craft = hc.vehicle("c17_experiment").with_effects([hc.effect("rudder_lag", seconds=0.1)])
    >>> plant = craft.plant()
    >>> commands_of(plant, {plant.parameter("rudder_lag_seconds").symbol})
    'command rudder'
    """
    of = {s.symbol: block.expand(block.derivatives[s.name]).free_symbols for s in block.states}
    inputs = {s.symbol: s.name for s in block.inputs}

    def passing(state: sp.Symbol) -> frozenset[str]:
        behind = {state}
        while more := {s for symbol in behind for s in of[symbol]} & of.keys() - behind:
            behind |= more
        return frozenset(inputs[s] for symbol in behind for s in of[symbol] if s in inputs)

    # A lag shares its symbols with the motion, which all commands reach: take the smallest sets of commands.
    ways = {passing(symbol) for symbol, law in of.items() if law & own}
    fewest = {way for way in ways if not any(other < way for other in ways if other)}
    names = [name for name in inputs.values() if any(name in way for way in fewest)]
    if not names or len(names) == len(block.inputs):
        return "all commands" if len(block.inputs) > 1 else f"command {block.inputs[0].name}"
    return f"command{'s' * (len(names) > 1)} {', '.join(names)}"
