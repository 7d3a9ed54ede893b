"""The cases of the benchmark: a machine, what its model lacks, a condition and a seed."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from zlib import crc32

import numpy as np
import sympy as sp
from numpy.typing import NDArray

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.signals import Signal
from hovercontrol.craft.effects.drag import per_second
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model
from hovercontrol.identification.benchmark.machines import MACHINES, Machine
from hovercontrol.logs import Log

Random = np.random.Generator

#: ``usual`` measurement noise; ``noise`` three times as much; ``dirt`` 2 % outliers of 50 standard
#: deviations, 5 % of the rows lost, stamps off by up to 15 % of a step; ``gusts`` random accelerations of
#: correlation time 0.3 s; ``mild`` what is missing has 40 % of its size.
CONDITIONS = ("usual", "noise", "dirt", "gusts", "mild")
NOTHING = "nothing"
EDITIONS = ("small", "full")
#: Seeds of the full edition.
SEEDS = 3
GUST_SECONDS = 0.3
ROWS = {"train": 2000, "holdout": 1200}


@checked
@dataclass(frozen=True)
class Truth:
    """What a model lacks.

    Attributes
    ----------
    name : str
        Name of an effect, of a law (``law_r_abs_v_r``), or ``"nothing"``.
    terms : dict of str to str
        By equation, the expression that is missing, up to its coefficient; empty for an effect that adds no
        single product (a lag).
    coefficient : float
        In the unit of the effect's first number, or of the law; NaN if nothing is missing.

    Examples
    --------
    >>> Truth("law_r_abs_v_r", {"r": "-Abs(v)*r"}, 0.6).name
    'law_r_abs_v_r'
    """

    name: str
    terms: dict[str, str]
    coefficient: float

    __repr__ = short_repr


@checked
@dataclass(frozen=True, eq=False)
class Case:
    """One case: what a tool is given, and the truth.

    Attributes
    ----------
    name : str
    model : Model or BlockModel
        The model that lacks something; its coefficients are up to 3 % off.
    train : tuple of Log
    holdout : Log
    truth : Truth
    motion : ndarray, shape (n, states)
        True states of the model at the rows of the held-out log, in SI units.

    Examples
    --------
    >>> case = benchmark_case("motor.speed_coulomb.usual.0")
    >>> case.truth.name, case.holdout.has("voltage", "speed")
    ('speed_coulomb', True)
    """

    name: str
    model: Model | BlockModel
    train: tuple[Log, ...]
    holdout: Log
    truth: Truth = field(repr=False)
    motion: Array = field(repr=False)

    __repr__ = short_repr


@checked
def benchmark_names(edition: str = "small") -> list[str]:
    """Return the names of the cases of an edition.

    Each machine has four effects of the catalogue, four laws outside it and, for every eight of these, two
    cases with nothing missing. The small edition has one condition of each, with seed 0; the full edition all
    conditions, with seeds 0 to 2.

    Parameters
    ----------
    edition : {"small", "full"}, optional

    Raises
    ------
    InputError
        If there is no such edition.

    Examples
    --------
    >>> len(benchmark_names("small")), len(benchmark_names("full"))
    (60, 900)
    >>> benchmark_names()[0]
    'rudder.yaw_quadratic_drag.usual.0'
    """
    check_known(edition, EDITIONS, f"edition: expected small or full, found {edition!r}")
    found = []
    for m, (name, machine) in enumerate(MACHINES.items()):
        lacks = [*machine.effects, *(law_name(*law) for law in machine.laws), NOTHING, NOTHING]
        for k, what in enumerate(lacks):
            second = k == len(lacks) - 1  # of the two cases with nothing missing
            if edition == "small":
                # effects and laws step through the conditions by different strides
                condition = CONDITIONS[(k + m) % 5 if k < 4 else (2 * k + m) % 5]
                found.append(f"{name}.{what}.{condition}.{int(second)}")
            else:
                for condition in CONDITIONS:
                    seeds = range(SEEDS) if what != NOTHING else range(int(second), 2 * SEEDS, 2)
                    found += [f"{name}.{what}.{condition}.{seed}" for seed in seeds]
    return found


@checked
def blind_names(key: str, edition: str = "small") -> dict[str, str]:
    """Return the cases of a blind run: a neutral name of each, and the case's name.

    Order and seeds follow from SHA-256 of the key. Whoever keeps the key keeps the answers; whoever gets the
    logs sees neutral names only.

    Parameters
    ----------
    key : str
        The secret.
    edition : {"small", "full"}, optional

    Raises
    ------
    InputError
        If the key is empty, or there is no such edition.

    Examples
    --------
    >>> cases = blind_names("a secret")
    >>> list(cases)[:2], cases == blind_names("a secret"), cases == blind_names("another")
    (['blind-001', 'blind-002'], True, False)
    """
    if not key:
        raise InputError("blind: expected a key, found an empty text")

    def hashed(name: str) -> int:
        return int.from_bytes(hashlib.sha256(f"{key}\0{name}".encode()).digest()[:6], "big")

    order = sorted(benchmark_names(edition), key=hashed)
    return {f"blind-{k:03}": f"{name.rpartition('.')[0]}.{hashed(name)}" for k, name in enumerate(order, 1)}


def law_name(equation: str, expression: str) -> str:
    """Return the name of a law in a case's name."""
    word = re.sub(r"\W+", "_", expression).strip("_").lower()
    return f"law_{equation}_{word}"


@checked
def benchmark_case(name: str) -> Case:
    """Return a case of the benchmark by its name, MACHINE.WHAT.CONDITION.SEED.

    Parameters
    ----------
    name : str
        Of :func:`benchmark_names`; any seed of 0 or more is accepted.

    Raises
    ------
    InputError
        If a part of the name is unknown; the message names the nearest.

    Examples
    --------
    >>> case = benchmark_case("ship.law_v_v_3.usual.0")
    >>> case.truth.terms, len(case.train)
    ({'v': '-v**3'}, 1)
    """
    machine, what, condition, seed = parsed(name)
    rng = np.random.default_rng([seed, crc32(f"{machine}.{what}.{condition}".encode())])
    kind = MACHINES[machine]
    true = _drawn(kind.model(), 0.2, rng)
    given = _drawn(true, 0.03, rng)
    plant, truth = _planted(kind, true, what, 0.4 if condition == "mild" else 1.0, rng)
    train, _ = _log(kind, plant, "train", condition, rng)
    holdout, motion = _log(kind, plant, "holdout", condition, rng)
    rows = [s.name for s in plant.states]
    own = [rows.index(s.name) for s in given.plant().states]
    return Case(name, given, (train,), holdout, truth, motion[:, own])


def parsed(name: str) -> tuple[str, str, str, int]:
    """Return machine, what is missing, condition and seed of a case's name.

    Raises
    ------
    InputError
        If a part is unknown.
    """
    machine, dot, rest = name.partition(".")
    ending = rest.rsplit(".", 2)
    if not dot or len(ending) != 3:
        raise InputError(f"benchmark: expected MACHINE.WHAT.CONDITION.SEED, found {name!r}")
    check_known(machine, MACHINES, f"benchmark: unknown machine {machine!r}")
    what, condition, seed = ending
    known = [*MACHINES[machine].effects, *(law_name(*law) for law in MACHINES[machine].laws), NOTHING]
    check_known(what, known, f"benchmark: {machine} has no case {what!r}")
    check_known(condition, CONDITIONS, f"benchmark: unknown condition {condition!r}")
    if not (seed.isascii() and seed.isdigit()):
        raise InputError(f"benchmark: expected a seed of 0 or more, found {seed!r}")
    return machine, what, condition, int(seed)


def lacks(name: str) -> str:
    """Return ``effect``, ``law`` or ``nothing``: what kind of thing a case lacks."""
    machine, what, *_ = parsed(name)
    if what == NOTHING:
        return NOTHING
    return "effect" if what in MACHINES[machine].effects else "law"


def _drawn(model: Model | BlockModel, part: float, rng: Random) -> Model | BlockModel:
    """Return the model with each coefficient, but for widths of friction, changed by up to `part`."""
    return model.with_coefficients({
        k: v if k.endswith("_width") else v * float(rng.uniform(1 - part, 1 + part))
        for k, v in model.coefficients().items()
    })  # fmt: skip


def _planted(
    kind: Machine, model: Model | BlockModel, what: str, part: float, rng: Random
) -> tuple[Block, Truth]:
    """Return the true plant, and what it has that the model lacks."""
    if what == NOTHING:
        return model.plant(), Truth(NOTHING, {}, math.nan)
    if what in kind.effects:
        values = {k: part * float(rng.uniform(*span)) for k, span in kind.effects[what].items()}
        missing = model.effect_class(what)(**values)
        return model.with_effects([missing]).plant(), Truth(what, {}, next(iter(values.values())))
    law = next(law for law in kind.laws if law_name(*law) == what)
    equation, text = law
    plant = model.plant()
    size = part * float(rng.uniform(*kind.laws[law]))
    law_term = expression_of(text, plant)
    hidden = Signal("hidden_law", law_unit(equation, law_term, plant), start=size)
    term = -hidden.symbol * law_term
    rates = {**plant.derivatives, equation: plant.derivatives[equation] + term}
    return with_rates(plant, rates, parameters=(hidden,)), Truth(what, {equation: f"-{text}"}, size)


def expression_of(text: str, block: Block) -> sp.Expr:
    """Return the expression of a text in the states and inputs of a Block.

    Raises
    ------
    InputError
        If the text is not an expression of these signals.
    """
    names = {s.name: s.symbol for s in (*block.states, *block.inputs)}
    try:
        found = sp.sympify(text, locals=names)
        known = isinstance(found, sp.Expr) and found.free_symbols <= set(names.values())
    except (sp.SympifyError, SyntaxError, TypeError, AttributeError):
        known = False
    if not known:
        raise InputError(f"expected an expression of {', '.join(names)}, found {text!r}")
    return found


def law_unit(equation: str, term: sp.Expr, block: Block) -> str:
    """Return the unit of the coefficient of a product of powers, absolute values and sines in an equation."""
    unit = f"({per_second(block.signal(equation).unit)})"
    for factor, power in term.as_powers_dict().items():
        signal = (
            next(iter(factor.free_symbols), None)
            if not isinstance(factor, sp.sin | sp.cos | sp.sign)
            else None
        )
        if signal is not None and block.signal(signal.name).unit != "1":
            unit += f"/({block.signal(signal.name).unit})^{power}"
    return unit


def with_rates(
    block: Block,
    rates: Mapping[str, sp.Expr],
    *,
    states: Sequence[Signal] = (),
    inputs: Sequence[Signal] = (),
    parameters: Sequence[Signal] = (),
) -> Block:
    """Return a Block with other derivatives, and further states, inputs and parameters."""
    outputs = {s.name: block.output_expressions[s.name] for s in block.outputs}
    return Block(
        block.name,
        (*block.states, *states),
        (*block.inputs, *inputs),
        block.outputs,
        (*block.parameters, *parameters),
        dict(rates),
        {name: e for name, e in outputs.items() if name not in rates},
        block.definitions,
    )


def _log(kind: Machine, plant: Block, name: str, condition: str, rng: Random) -> tuple[Log, Array]:
    """Return a log, and the true states at the rows of the log."""
    n, dt = ROWS[name], kind.dt
    t: Array = (dt * np.arange(n)).astype(float)
    commands = {k: steps(rng, n, dt, kind.hold, span) for k, span in kind.commands.items()}
    pushes: dict[str, Array] = {}
    if condition == "gusts":
        signals = {e: Signal(f"gust_{e}", per_second(plant.signal(e).unit)) for e in kind.gusts}
        added = {e: plant.derivatives[e] + s.symbol for e, s in signals.items()}
        plant = with_rates(plant, {**plant.derivatives, **added}, inputs=tuple(signals.values()))
        pushes = {f"gust_{e}": gust(rng, n, dt, size) for e, size in kind.gusts.items()}
    run = plant.compile(friction="smooth").simulate(t, {**commands, **pushes}, rtol=1e-7, atol=1e-9)
    states = np.atleast_2d(run.states)
    rows = {s.name: k for k, s in enumerate(plant.states)}
    more = 3.0 if condition == "noise" else 1.0
    seen = {c: states[rows[c]] + more * size * rng.normal(size=n) for c, size in kind.noise.items()}
    log, kept = Log(name, t, {**seen, **commands}), np.arange(n)
    if condition == "dirt" and name == "train":
        log, kept = dirty(log, kind, rng)
    return log, states.T[kept]


def steps(rng: Random, n: int, dt: float, hold: tuple[float, float], span: tuple[float, float]) -> Array:
    """Return random steps, shape (n,); each holds for a time between the two of `hold` [s]."""
    values, k = np.zeros(n), 0
    while k < n:
        count = max(1, int(rng.uniform(*hold) / dt))
        values[k : k + count] = rng.uniform(*span)
        k += count
    return values


def gust(rng: Random, n: int, dt: float, size: float) -> Array:
    """Return an Ornstein-Uhlenbeck process of standard deviation `size`, shape (n,)."""
    fade = math.exp(-dt / GUST_SECONDS)
    values = np.empty(n)
    values[0] = size * rng.normal()
    for k, z in enumerate(rng.normal(size=n - 1), 1):
        values[k] = fade * values[k - 1] + size * math.sqrt(1 - fade**2) * z
    return values


def dirty(log: Log, kind: Machine, rng: Random) -> tuple[Log, NDArray[np.intp]]:
    """Return the log with outliers, lost rows and jittered stamps, and the rows that are left."""
    n, columns = len(log), dict(log.columns)
    for c, size in kind.noise.items():
        columns[c] = columns[c] + (rng.random(n) < 0.02) * 50.0 * size * rng.normal(size=n)
    stamps = log.time + rng.uniform(-0.15, 0.15, n) * kind.dt
    kept = np.flatnonzero(rng.random(n) > 0.05)
    return replace(log, time=stamps[kept], columns={k: v[kept] for k, v in columns.items()}), kept


def given_model(machine: str, values: Mapping[str, float]) -> Model | BlockModel:
    """Return the model of a machine with these coefficients, as the files of a case have it.

    Raises
    ------
    InputError
        If the machine or a coefficient is unknown.
    """
    check_known(machine, MACHINES, f"benchmark: unknown machine {machine!r}")
    return MACHINES[machine].model().with_coefficients(values)
