"""Can a smooth static state feedback hold an equilibrium? The tests of Brockett, and of Byrnes and Isidori.

K06 uses both [K06 theorem 2.3.1, 2.3.3] to show that no such feedback holds a hovercraft's pose or heading
[K06 proposition 2.3.2, 2.3.4]; the forms are those of [K06 eq 2.49, 2.51] and the map of [K06 eq 2.56].
Of a sampled Block, x+ = f(x, u), Brockett's condition is that (x, u) -> f(x, u) - x is onto a neighbourhood
of 0: a fixed point that attracts has the index 1 [Krasnosel'skii and Zabreiko, Geometrical Methods of
Nonlinear Analysis, 1984]. The theorem of Byrnes and Isidori is of continuous time.

Ranks are exact: the Block's numbers become fractions, and solvability of polynomial equations is decided by
a Groebner basis, heading angles by their sine and cosine.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError, check_known
from hovercontrol.blocks.backends.trim_conditions import rate_name, with_rates
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.linear_systems import growth
from hovercontrol.blocks.sgn import regularise
from hovercontrol.blocks.signals import time
from hovercontrol.control.analysis.polynomials import unsolvable

#: An eigenvalue whose real part is within this of zero is on the imaginary axis.
ON_AXIS = 1e-9

Verdict = Literal["possible", "impossible", "undecided"]


@dataclass(frozen=True)
class Linearised:
    """The linearisation at the equilibrium.

    Attributes
    ----------
    rank, order : int
        Of the controllability matrix, and the number of states.
    uncontrollable : tuple of complex
        Eigenvalues that no feedback moves, of a sampled Block those of its map.
    """

    rank: int
    order: int
    uncontrollable: tuple[complex, ...]


@dataclass(frozen=True)
class Brockett:
    """Condition (iii) of K06 theorem 2.3.3: the map (x, u) -> rates is onto a neighbourhood of 0.

    Attributes
    ----------
    onto : bool or None
        None where it is not decided.
    rank : int
        Of [A B]; equal to the number of states it proves `onto`.
    missed : dict of str to sympy.Expr
        Rates of the states that no state and input gives, however small they are (times any factor but 0); of
        a sampled Block changes per step.
    """

    onto: bool | None
    rank: int
    missed: dict[str, sp.Expr]


@dataclass(frozen=True)
class ByrnesIsidori:
    """K06 theorem 2.3.1 for x1' = f1(x) x1 + sum b_i u_i, x2' = f2(x).

    Attributes
    ----------
    pushed, carried : tuple of str
        The states x1, on which inputs act, and x2.
    unmet : str
        The hypothesis that does not hold; empty if the theorem applies.
    directions : int
        m', the dimension of the span of the b_i. A smooth feedback exists if and only if it is len(pushed).
    """

    pushed: tuple[str, ...]
    carried: tuple[str, ...]
    unmet: str
    directions: int

    @property
    def stabilizable(self) -> bool | None:
        """What the theorem says; None where it does not apply."""
        return None if self.unmet else self.directions == len(self.pushed)


#: What the theorem says of a sampled Block.
NOT_CONTINUOUS = ByrnesIsidori((), (), "time is continuous", 0)


@checked
@dataclass(frozen=True)
class Stabilizability:
    """Whether a smooth static state feedback can make an equilibrium asymptotically stable.

    Attributes
    ----------
    block : str
    states : tuple of str
    linearised : Linearised
    brockett : Brockett
    byrnes_isidori : ByrnesIsidori
    sampled : bool
        Whether the Block is sampled.

    Examples
    --------
    >>> import hovercontrol as hc
    >>> from hovercontrol.control.controllers.k06 import force_driven
    >>> found = stabilizability(force_driven(hc.vehicle("hoverdemon").plant()))
    >>> found.linearised.rank, found.brockett.onto
    (4, False)
    """

    block: str
    states: tuple[str, ...]
    linearised: Linearised
    brockett: Brockett
    byrnes_isidori: ByrnesIsidori
    sampled: bool = False

    def __repr__(self) -> str:
        return self.sentence()

    @property
    def verdict(self) -> Verdict:
        """Return ``possible``, ``impossible`` or ``undecided``."""
        stuck = growth(self.linearised.uncontrollable, self.sampled).tolist()
        theorem = self.byrnes_isidori.stabilizable
        if any(re > ON_AXIS for re in stuck) or self.brockett.onto is False or theorem is False:
            return "impossible"
        if all(re < -ON_AXIS for re in stuck) or theorem:
            return "possible"
        return "undecided"

    def sentence(self) -> str:
        """Return the answer in plain words, with the reasons."""
        what = f"the equilibrium of {self.block} in ({', '.join(self.states)})"
        lin, b, bi = self.linearised, self.brockett, self.byrnes_isidori
        reasons = []
        if not lin.uncontrollable:
            reasons.append("its linearisation is controllable")
        else:
            stuck = ", ".join(_number(v) for v in lin.uncontrollable)
            reasons.append(
                f"of its linearisation's {lin.order} modes inputs move {lin.rank}; the others stay at {stuck}"
            )
        if b.onto is False:
            rate = " per step" if self.sampled else "'"
            rates = ", ".join(f"{name}{rate} = {value}" for name, value in b.missed.items() if value != 0)
            reasons.append(
                f"Brockett's condition fails: no state and input give the rates {rates} with the others "
                "zero, or any multiple of them"
            )
        if bi.stabilizable is not None:
            reasons.append(
                f"Byrnes and Isidori: inputs push in {bi.directions} directions, and "
                f"{', '.join(bi.pushed)} are {len(bi.pushed)}"
            )
        answer = {
            "possible": f"A smooth static state feedback can hold {what}",
            "impossible": f"No smooth static state feedback can hold {what}",
            "undecided": f"These tests do not decide whether a smooth static state feedback can hold {what}",
        }[self.verdict]
        more = {"impossible": "; use one that switches or depends on time"}.get(self.verdict, "")
        return f"{answer}: {'; '.join(reasons)}{more}."


@checked
def stabilizability(
    block: Block, states: Sequence[str] | None = None, at: Mapping[str, float] | None = None
) -> Stabilizability:
    """Check whether a smooth static state feedback can hold an equilibrium of a Block.

    Parameters
    ----------
    block : Block
        Continuous or sampled, affine in its inputs (a craft with rudder and propeller is so in the force
        vector, see the example).
    states : sequence of str, optional
        The states that matter, which must not depend on the others; default all.
    at : mapping, optional
        The equilibrium by names of states and inputs, over zero.

    Returns
    -------
    Stabilizability

    Raises
    ------
    InputError
        If a name is unknown, the Block has no input, depends on time or is not affine in an input, the
        states depend on others, or it is no equilibrium.

    Notes
    -----
    K06 theorems 2.3.1 (Byrnes and Isidori) and 2.3.3 (Brockett), propositions 2.3.2 and 2.3.4. Dry friction
    is taken in its smooth form.

    Examples
    --------
    >>> from hovercontrol import interconnect, vehicle
    >>> from hovercontrol.control.controllers.k06 import force_to_command
    >>> craft = interconnect([vehicle("hoverdemon").plant(), force_to_command()])
    >>> stabilizability(craft).verdict
    'impossible'
    >>> stabilizability(craft, ["plant.u", "plant.v", "plant.r"], at={"plant.u": 1.1}).verdict
    'possible'
    """
    plain = with_rates(block)
    x, u, f = _exact(plain, states)
    here = _equilibrium(block, x, u, at or {})
    moving = [(name, e) for name, e in zip(_names(x), f, strict=True) if sp.simplify(e.xreplace(here)) != 0]
    if moving:
        name, e = moving[0]
        rate = f"{rate_name(block, name)} = {sp.N(e.xreplace(here), 4)}"
        raise InputError(f"block {block.name!r}: no equilibrium: {rate} there")
    shift = {s: s + value for s, value in here.items()}
    f = f.xreplace(shift).applyfunc(sp.expand_trig)
    zero = dict.fromkeys([*x, *u], sp.S.Zero)
    A, B = (f.jacobian(by).xreplace(zero) for by in (x, u))
    sampled = block.period > 0.0
    theorem = NOT_CONTINUOUS if sampled else _byrnes_isidori(f, x, u, zero)
    linear = _linearised(A + sp.eye(len(x)) if sampled else A, B)
    return Stabilizability(block.name, _names(x), linear, _brockett(f, x, u, A, B), theorem, sampled)


def _exact(block: Block, states: Sequence[str] | None) -> tuple[list[sp.Symbol], list[sp.Symbol], sp.Matrix]:
    """Return states, inputs and derivatives with the Block's numbers as fractions."""
    known = [s.name for s in block.states]
    names = known if states is None else list(states)
    for name in names:
        check_known(name, known, f"block {block.name!r}: no state {name!r}")
    if not block.inputs or not names:
        raise InputError(f"block {block.name!r}: a check of feedback needs states and inputs")
    x, u = [block.signal(n).symbol for n in names], [s.symbol for s in block.inputs]
    numbers = {p.symbol: sp.nsimplify(p.start, rational=True) for p in block.parameters}
    f = sp.Matrix([regularise(block.expand(block.derivatives[n])).xreplace(numbers) for n in names])
    for name, e in zip(names, f, strict=True):
        for other in sorted(e.free_symbols - {*x, *u}, key=str):
            where = "time" if other == time else f"the state {other}, which is left out"
            raise InputError(f"block {block.name!r}: {name}' depends on {where}")
    for symbol in u:
        if any(sp.simplify(sp.diff(e, symbol, other)) != 0 for e in f for other in u):
            raise InputError(
                f"block {block.name!r}: not affine in the input {symbol.name!r}; for a propeller with a "
                "rudder interconnect the plant with force_to_command(), and the force is the input"
            )
    return x, u, f


def _names(symbols: Sequence[sp.Symbol]) -> tuple[str, ...]:
    return tuple(s.name for s in symbols)


def _number(value: complex) -> str:
    return f"{value.real:.3g}" if abs(value.imag) < ON_AXIS else f"{value:.3g}"


def _equilibrium(
    block: Block, x: Sequence[sp.Symbol], u: Sequence[sp.Symbol], at: Mapping[str, float]
) -> dict[sp.Symbol, sp.Expr]:
    names = [s.name for s in (*x, *u)]
    for name in at:
        check_known(name, names, f"block {block.name!r}: no state or input {name!r} in the check")
    return {s: sp.nsimplify(at.get(s.name, 0.0), rational=True) for s in (*x, *u)}


def _linearised(A: sp.Matrix, B: sp.Matrix) -> Linearised:
    n = A.rows
    columns = [B]
    for _ in range(n - 1):
        columns.append(A * columns[-1])
    reach = sp.Matrix.hstack(*columns).columnspace()
    # the reachable directions, then as many others as there are states
    T = sp.Matrix.hstack(*sp.Matrix.hstack(*reach, sp.eye(n)).columnspace())
    left_over = (T.inv() * A * T)[len(reach) :, len(reach) :]
    values: list[complex] = []
    if left_over:
        for factor, times in sp.Poly(left_over.charpoly().as_expr()).factor_list()[1]:
            values += [complex(root) for root in factor.nroots()] * times  # multiple roots stay exact
    return Linearised(len(reach), n, tuple(values))


def _brockett(
    f: sp.Matrix, x: Sequence[sp.Symbol], u: Sequence[sp.Symbol], A: sp.Matrix, B: sp.Matrix
) -> Brockett:
    both = sp.Matrix.hstack(A, B)
    rank = both.rank()
    if rank == len(x):
        return Brockett(True, rank, {})
    size = sp.Dummy("size", real=True)
    for direction in both.T.nullspace():  # rates that the linearisation does not give
        if unsolvable([*(f - size * direction)], [*x, *u, size], nonzero=size):
            return Brockett(False, rank, dict(zip(_names(x), direction, strict=True)))
    return Brockett(None, rank, {})


def _byrnes_isidori(
    f: sp.Matrix, x: Sequence[sp.Symbol], u: Sequence[sp.Symbol], zero: Mapping[sp.Symbol, sp.Expr]
) -> ByrnesIsidori:
    pushed = [k for k, e in enumerate(f) if e.has(*u)]
    carried = [k for k in range(len(x)) if k not in pushed]
    x1, f2 = [x[k] for k in pushed], sp.Matrix([f[k] for k in carried])
    b = sp.Matrix([f[k] for k in pushed]).jacobian(u)
    drift = [f[k].xreplace({**dict.fromkeys(u, sp.S.Zero), **{s: sp.S.Zero for s in x1}}) for k in pushed]
    unmet = ""
    if b.free_symbols:
        unmet = "the inputs' directions are constant"
    elif any(sp.simplify(e) != 0 for e in drift):
        unmet = f"without inputs {', '.join(_names(x1))} stay at zero"
    elif not carried or not f2.has(*x1):
        unmet = "other states are moved by those that inputs push"
    elif not all(unsolvable([*f2], [*x], nonzero=s) for s in x1):
        unmet = "H1: the other states rest only where those that inputs push are zero"
    elif f2.jacobian(x1).xreplace(dict(zero)).rank() < len(carried):
        unmet = "H2: the other states can be moved in every direction"
    return ByrnesIsidori(_names(x1), tuple(x[k].name for k in carried), unmet, b.rank())
