"""How an answer is scored against the truth of a case."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass

import numpy as np
import sympy as sp

from hovercontrol.base.arrays import Array
from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.short_repr import short_repr
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.sgn import regularise
from hovercontrol.craft.models.interface import as_model
from hovercontrol.identification.benchmark.answer import Answer, Term
from hovercontrol.identification.benchmark.cases import NOTHING, Case, expression_of

#: Times ahead [s] of the predictions of the held-out motion, and how many start in a log.
HORIZONS = (0.2, 1.0)
STARTS = 200
#: In a log, a delay of all inputs is a clock that is late: one finding under two names.
ONE_FINDING = {"time_offset": "input_delay"}


@checked
@dataclass(frozen=True)
class Score:
    """The score of one answer; a figure that does not apply is None.

    Attributes
    ----------
    missing : bool
        Whether the model lacks something.
    detected : bool
        Whether the verdict says rightly that something, or nothing, is missing; ``"unknown"`` does not.
    form : bool or None
        Whether one sure term is what is missing: the effect's name, or an expression that is equal up to its
        coefficient in the right equation. None if nothing is missing.
    reading : bool or None
        The same for any term, sure or not.
    equation : bool or None
        Whether a sure term acts in the right equation.
    coefficient : bool or None
        Whether the truth lies within two standard errors; None without a right form or a standard error.
    false_names : int
        Sure terms of the verdict ``"missing"`` that are not what is missing.
    reduction : dict of str to float
        By time ahead: by what share of the root mean square error of the given model, averaged over states,
        the prediction of the held-out motion improves. Empty where nothing is missing or predicted.

    Examples
    --------
    >>> Score(True, True, True, True, True, True, 0, {"0.2": 0.8}).detected
    True
    """

    missing: bool
    detected: bool
    form: bool | None
    reading: bool | None
    equation: bool | None
    coefficient: bool | None
    false_names: int
    reduction: dict[str, float]

    __repr__ = short_repr

    def result(self) -> dict[str, object]:
        """Return the figures by name, as JSON has them.

        Examples
        --------
        >>> Score(True, True, True, True, True, True, 0, {}).result()["false_names"]
        0
        """
        return asdict(self)


@checked
def score_answer(case: Case, answer: Answer) -> Score:
    """Return the score of an answer.

    Parameters
    ----------
    case : Case
    answer : Answer

    Raises
    ------
    InputError
        If a term is neither an effect of the model's catalogue nor an expression of its signals.

    Examples
    --------
    >>> from hovercontrol.identification.benchmark import benchmark_case
    >>> case = benchmark_case("ship.law_v_v_3.usual.0")
    >>> found = score_answer(case, Answer("missing", (Term("v", "v**3"), Term("r", "r"))))
    >>> found.form, found.equation, found.false_names
    (True, True, 1)
    """
    missing = case.truth.name != NOTHING
    said = {"missing": True, "none": False}.get(answer.verdict)
    detected = said is missing
    wanted = _forms(case, Term("", case.truth.name)) if not case.truth.terms else _own_forms(case)
    sure = [t for t in answer.terms if t.sure and said]
    right = {id(t): _same(case, t, wanted) for t in answer.terms}
    false = sum(not right[id(t)] for t in sure)
    if not missing:
        return Score(False, detected, None, None, None, None, false, {})
    matches = [t for t in sure if right[id(t)]]
    # an effect in several equations may be answered by an expression in each
    hit = {e for t in matches for e in _equations(case, t, wanted)}
    form = any(_named(case, t) for t in matches) or (bool(wanted) and hit >= set(wanted))
    return Score(
        True,
        detected,
        form,
        form or any(right.values()),
        any(_equations(case, t, wanted) & set(wanted) for t in sure) if wanted else form,
        _within(case, matches, wanted) if form else None,
        false,
        reductions(case, answer),
    )


def _finding(name: str) -> str:
    return ONE_FINDING.get(name, name)


def _named(case: Case, term: Term) -> bool:
    return not case.truth.terms and _finding(term.text) == _finding(case.truth.name)


def _own_forms(case: Case) -> dict[str, sp.Expr]:
    block = case.model.plant()
    return {e: expression_of(text, block) for e, text in case.truth.terms.items()}


def _forms(case: Case, term: Term) -> dict[str, sp.Expr]:
    """Return the expressions of a term by equation: of an effect, its terms at a coefficient of one."""
    model = as_model(case.model)
    block = model.plant()
    try:
        cls = model.effect_class(term.text)
    except InputError:
        return {term.equation: expression_of(term.text, block)} if term.text != NOTHING else {}
    return {e: x for e, x in effect_terms(model, cls).items() if x != 0}


def effect_terms(model: object, cls: type) -> dict[str, sp.Expr]:
    """Return by equation what an effect adds, per unit of its first number; empty if that is not linear."""
    given = as_model(model)  # type: ignore[arg-type]
    first = next(iter(cls.numbers))  # type: ignore[attr-defined]
    try:
        start = cls.small().values  # type: ignore[attr-defined]
        block, base = given.with_effects([cls(**{**start, first: 1.0})]).plant(), given.plant()
    except InputError:
        return {}
    if len(block.states) != len(base.states):  # it has a memory: no term of states and inputs
        return {}
    values = {p.symbol: sp.Float(p.start) for p in block.parameters if p not in base.parameters}
    found = {}
    for s in base.states:
        more = sp.expand(block.expand(block.derivatives[s.name]) - base.expand(base.derivatives[s.name]))
        if more != 0:
            found[s.name] = regularise(more.xreplace(values))
    known = {s.symbol for s in (*base.states, *base.inputs)}
    return found if all(e.free_symbols <= known for e in found.values()) else {}


def _equations(case: Case, term: Term, wanted: Mapping[str, sp.Expr]) -> set[str]:
    if _named(case, term):
        return set(wanted)
    return set(_forms(case, term))


def _same(case: Case, term: Term, wanted: Mapping[str, sp.Expr]) -> bool:
    """Return whether a term is what is missing, or one equation of it."""
    if _named(case, term):
        return True
    forms = _forms(case, term)
    return bool(forms) and all(e in wanted and ratio(x, wanted[e]) is not None for e, x in forms.items())


def ratio(one: sp.Expr, other: sp.Expr) -> float | None:
    """Return the number c of ``one = c other``, None if there is none: by values at random points."""
    symbols = sorted(one.free_symbols | other.free_symbols, key=str)
    if one.free_symbols != other.free_symbols:
        return None
    points = np.random.default_rng(0).uniform(-1.7, 1.7, (len(symbols), 40))
    a, b = (
        np.broadcast_to(np.asarray(sp.lambdify(symbols, e, "numpy")(*points), dtype=float), (40,))
        for e in (one, other)
    )
    c = float(a @ b / (b @ b)) if (b @ b) > 0 else 0.0
    close = np.allclose(a, c * b, rtol=1e-6, atol=1e-9 * float(np.abs(a).max(initial=0.0)))
    return c if close and c != 0.0 else None


def _within(case: Case, matches: list[Term], wanted: Mapping[str, sp.Expr]) -> bool | None:
    """Return whether the coefficient of the first right term lies within two standard errors."""
    term = matches[0]
    if term.coefficient is None or not term.std:
        return None
    factor: float | None = 1.0
    if not _named(case, term):
        (equation, form), *_ = _forms(case, term).items()
        factor = ratio(wanted[equation], form)
    if factor is None:
        return None
    return abs(term.coefficient - factor * case.truth.coefficient) <= 2 * term.std


# ---- the held-out motion --------------------------------------------------------------------------------


def reductions(case: Case, answer: Answer) -> dict[str, float]:
    """Return by what share the error of the predicted held-out motion falls, by time ahead.

    Predictions start from the true states and are compared with the true states, so that measurement noise
    has no part in the figure::

        1 - mean over states of (rms error of the answer's model / rms error of the given model)
    """
    if answer.predicted is None:
        return {}
    before = _errors(case, as_model(case.model).plant())
    try:
        after = _errors(case, as_model(answer.predicted).plant())
    except (InputError, ValueError):
        return {}
    found = {}
    for horizon in HORIZONS:
        a, b = before[horizon], after[horizon]
        known = a > 1e-3 * a.max(initial=0.0)
        left = b[known] / a[known]
        found[f"{horizon:g}"] = (
            float(1.0 - left.mean()) if np.isfinite(left).all() and left.size else -math.inf
        )
    return found


def _errors(case: Case, plant: Block) -> dict[float, Array]:
    """Return the root mean square error of each state of the given model, by time ahead."""
    log, own = case.holdout, as_model(case.model).plant()
    names = [s.name for s in own.states]
    rows = [s.name for s in plant.states]
    inputs = np.array([log[s.name] for s in plant.inputs])
    n = len(log)
    dt = float(np.median(np.diff(log.time)))
    x = np.zeros((len(rows), n))
    if len(rows) > len(names):  # states of effects, driven by the same inputs from the log's begin
        commands = dict(zip([s.name for s in plant.inputs], inputs, strict=True))
        x = np.atleast_2d(plant.compile(friction="smooth").simulate(log.time, commands).states).copy()
    at = [rows.index(name) for name in names]
    x[at] = case.motion.T
    longest = round(HORIZONS[-1] / dt)
    start = np.unique(np.linspace(0, n - 1 - longest, STARTS).astype(int))
    derivatives = plant.to_numpy().derivatives
    now, found, fine = x[:, start], {}, max(2, math.ceil(dt / 5e-3))
    h = dt / fine
    with np.errstate(all="ignore"):
        for k in range(1, longest + 1):
            u = inputs[:, start + k - 1]
            for _ in range(fine):  # Runge-Kutta of order 4, inputs held
                a = derivatives(0.0, now, u)
                b = derivatives(0.0, now + 0.5 * h * a, u)
                c = derivatives(0.0, now + 0.5 * h * b, u)
                d = derivatives(0.0, now + h * c, u)
                now = now + h / 6 * (a + 2 * b + 2 * c + d)
            for horizon in HORIZONS:
                if k == round(horizon / dt):
                    error = now[at] - case.motion[start + k].T
                    found[horizon] = np.sqrt(np.mean(error**2, axis=1))
    return found
