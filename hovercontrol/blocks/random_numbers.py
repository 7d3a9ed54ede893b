"""Random numbers as equations of a sampled Block, so that every backend draws the same ones from a seed.

The generator is L'Ecuyer's MRG32k3a ("Good parameters and implementations for combined multiple recursive
random number generators", Operations Research 47, 1999). It has two recurrences of order 3 with values below
2^32. All products are whole numbers below 2^53, hence exact in double precision. Its period is about 2^191::

    p(n) = (1403580 p(n-2) - 810728 p(n-3)) mod m1,   m1 = 4294967087
    q(n) = (527612 q(n-1) - 1370589 q(n-3)) mod m2,   m2 = 4294944443
    u(n) = d/(m1 + 1),   d = p(n) - q(n) if p(n) > q(n), else p(n) - q(n) + m1
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import sympy as sp

from hovercontrol.base.errors import InputError
from hovercontrol.blocks.expressions import Definitions
from hovercontrol.blocks.signals import Signal

M1, M2 = 4294967087, 4294944443
A12, A13 = 1403580, 810728
A21, A23 = 527612, 1370589

#: Largest seed. Seeds are mixed by a Lehmer generator with the modulus 2^31 - 1.
LARGEST_SEED = 2**31 - 3
_LEHMER, _PRIME = 48271, 2**31 - 1


@dataclass(frozen=True)
class Noise:
    """The parts of a sampled Block that draw random numbers.

    Attributes
    ----------
    states : tuple of Signal
        Six states; if all are zero, the generator starts from the seed.
    next_values : dict of str to sympy.Expr
        Next values of the states, for the Block's ``derivatives``.
    definitions : dict of str to sympy.Expr
    parameters : tuple of Signal
        The seed.
    values : tuple of sympy.Symbol
        The numbers drawn at this tick. They are independent of each other and of other ticks.
    """

    states: tuple[Signal, ...]
    next_values: dict[str, sp.Expr]
    definitions: dict[str, sp.Expr]
    parameters: tuple[Signal, ...]
    values: tuple[sp.Symbol, ...]


def random_numbers(
    count: int,
    *,
    salt: str,
    kind: Literal["normal", "uniform"] = "normal",
    seed: int = 1,
    prefix: str = "noise",
) -> Noise:
    """Return the parts of a sampled Block that draw `count` random numbers at each of its ticks.

    Parameters
    ----------
    count : int
        Numbers per tick.
    salt : str
        Text that varies the numbers: Blocks with different salts draw different numbers from the same seed.
        The Block's name is a good choice.
    kind : {"normal", "uniform"}, optional
        Normal with mean 0 and variance 1 (Box-Muller transform), or uniform in the open interval (0, 1).
    seed : int, optional
        Start value of the parameter ``seed``.
    prefix : str, optional
        Prefix of the names of states and definitions.

    Raises
    ------
    InputError
        If `count` is not positive, `kind` is unknown, or the seed is not a whole number from 0 to 2^31 - 3.

    Examples
    --------
    A Block that draws two numbers a second.

    >>> from hovercontrol.blocks.block import Block
    >>> from hovercontrol.blocks.simulation.sampled import Ticking
    >>> noise = random_numbers(2, salt="dice", kind="uniform")
    >>> a, b = Signal("a"), Signal("b")
    >>> dice = Block("dice", noise.states, [], [a, b], noise.parameters, noise.next_values,
    ...              dict(zip("ab", noise.values)), noise.definitions, period=1.0)
    >>> one, other = Ticking(dice), Ticking(dice, {"dice.seed": 2.0})
    >>> one.tick(0.0, {}) != one.tick(1.0, {}) != other.tick(0.0, {})
    True
    """
    if count < 1:
        raise InputError(f"random_numbers: count must be positive, found {count!r}")
    if kind not in ("normal", "uniform"):
        raise InputError(f"random_numbers: kind must be 'normal' or 'uniform', found {kind!r}")
    if not (isinstance(seed, int) and 0 <= seed <= LARGEST_SEED):
        raise InputError(f"random_numbers: a seed is a whole number from 0 to {LARGEST_SEED}, found {seed!r}")
    key = Signal("seed", "1", "of the random numbers", start=seed, lower=0.0, upper=LARGEST_SEED)
    states = tuple(
        Signal(f"{prefix}_{row}{k}", "1", "of the random number generator") for row in "pq" for k in range(3)
    )
    define = Definitions(prefix=f"{prefix}_")
    now = _seeded(states, key.symbol, salt, define)
    # now = [p(n-3), p(n-2), p(n-1), q(n-3), q(n-2), q(n-1)]
    uniform = []
    for k in range(count + count % 2 if kind == "normal" else count):
        p = define(f"p_next{k}", _rest(A12 * now[1] - A13 * now[0], M1, define, f"p{k}"))
        q = define(f"q_next{k}", _rest(A21 * now[5] - A23 * now[3], M2, define, f"q{k}"))
        now = [now[1], now[2], p, now[4], now[5], q]
        apart = define(f"difference{k}", sp.Piecewise((p - q, p > q), (p - q + M1, True)))
        uniform.append(define(f"uniform{k}", apart / (M1 + 1)))
    values = uniform
    if kind == "normal":
        # Box-Muller: z_k = sqrt(-2 ln u_k) cos(2 pi u_{k+1}),  z_{k+1} = sqrt(-2 ln u_k) sin(2 pi u_{k+1})
        values = []
        for k in range(0, count, 2):
            radius = define(f"radius{k}", sp.sqrt(-2 * sp.log(uniform[k])))
            turn = define(f"angle{k}", 2 * sp.pi * uniform[k + 1])
            values += [define(f"normal{k}", radius * sp.cos(turn))]
            values += [define(f"normal{k + 1}", radius * sp.sin(turn))] if k + 1 < count else []
    return Noise(
        states,
        {s.name: e for s, e in zip(states, now, strict=True)},
        define,
        (key,),
        tuple(values),
    )


def _rest(product: sp.Expr, modulus: int, define: Definitions, name: str) -> sp.Expr:
    """Return x mod m = x - m floor(x/m), x the product; a quotient rounded up by one is corrected."""
    whole = define(f"{name}_product", product)
    rest = define(f"{name}_rest", whole - modulus * sp.floor(whole / modulus))
    return sp.Piecewise((rest + modulus, rest < 0), (rest, True))


def _seeded(states: Sequence[Signal], seed: sp.Symbol, salt: str, define: Definitions) -> list[sp.Symbol]:
    """Return the generator's six numbers; if all states are zero, they are computed from the seed."""
    # Lehmer generator: s_{k+1} = max(48271 s_k mod (2^31 - 1), 1) from s_0 = seed + 1; in the second step the
    # salt's CRC-32 mod (2^31 - 2) is added to the product. The first 2 of 8 values are discarded, because
    # they are similar for neighbouring seeds.
    number = define("seed", seed + 1)
    shift = zlib.crc32(salt.encode()) % (_PRIME - 1)
    found = []
    for k in range(8):
        mixed = define(f"seed{k}_mixed", _LEHMER * number + (shift if k == 1 else 0))
        number = define(f"seed{k}", sp.Max(mixed - _PRIME * sp.floor(mixed / _PRIME), 1))
        found.append(number)
    fresh = sum((s.symbol for s in states), sp.S.Zero)
    return [
        define(f"now{k}", sp.Piecewise((s.symbol, fresh > 0), (number, True)))
        for k, (s, number) in enumerate(zip(states, found[2:], strict=True))
    ]
