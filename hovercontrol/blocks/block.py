"""The Block: a dynamic system written once, from which every other form is derived.

A Block knows its signals and their expressions, nothing of solvers, vehicles or tools. Its backends are in
:mod:`hovercontrol.blocks.backends` and above; :mod:`hovercontrol.blocks.block_backends` has the methods that
call them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any, Literal

import sympy as sp

from hovercontrol.base.annotations import fits
from hovercontrol.base.boundary import checked, checks_itself
from hovercontrol.base.errors import InputError, by_last_part, check_known, did_you_mean, shown
from hovercontrol.blocks.block_backends import Backends
from hovercontrol.blocks.checking import check
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.blocks.signals import Signal
from hovercontrol.blocks.summary import block_summary
from hovercontrol.blocks.ticks import Tick as Tick

Rows = Literal["derivatives", "outputs"]
Columns = Literal["states", "inputs", "parameters"]


@checked
@dataclass(frozen=True)
class Block(Backends):
    """A dynamic system: named signals and their expressions.

    Parameters
    ----------
    name : str
        An identifier; the prefix of the Block's parameter keys.
    states, inputs, outputs, parameters : sequence of Signal
        Names are unique within the Block; an output may carry the name of a state, an input or a
        definition when it is just that.
    derivatives : mapping of str to sympy.Expr
        The time derivative of each state; of a sampled Block its next value.
    output_expressions : mapping of str to sympy.Expr, optional
        One for each output; an output named like a state, an input or a definition may be left out.
    definitions : mapping of str to sympy.Expr, optional
        Named intermediate quantities, in any order, that other expressions use.
    definition_signals : sequence of Signal, optional
        Unit and description of definitions, where they are known; derived otherwise.
    period : float, optional
        Of a sampled Block [s]: at every multiple its outputs are computed and held, then its states take
        their next values. 0 (the default) for a continuous one.
    ticks : sequence of Tick, optional
        Of a hybrid Block, made by :func:`~hovercontrol.blocks.interconnect.interconnect`: what sets the last
        of its states, which hold their values in between.
    delays : mapping of str to sympy.Expr, optional
        How late inputs act [s], of parameters alone and never negative. In the expressions the symbol of such
        an input is its value as it arrives; until the first value arrives that is its start value. See
        :mod:`hovercontrol.blocks.delays`.

    Raises
    ------
    InputError
        If a name is used twice, a symbol is unknown, an expression is missing, or definitions are circular.
    UnitError
        If an expression adds what cannot be added; the line names the expression.

    Examples
    --------
    >>> v, F, m = Signal("v", "m/s"), Signal("F", "N"), Signal("m", "kg", start=2.0)
    >>> cart = Block("cart", [v], [F], [v], [m], {"v": F.symbol / m.symbol})
    >>> print(cart.equations())
    v' = F/m
    """

    name: str
    states: tuple[Signal, ...] = ()
    inputs: tuple[Signal, ...] = ()
    outputs: tuple[Signal, ...] = ()
    parameters: tuple[Signal, ...] = ()
    derivatives: Mapping[str, sp.Expr] = field(default_factory=Expressions)
    output_expressions: Mapping[str, sp.Expr] = field(default_factory=Expressions)
    definitions: Mapping[str, sp.Expr] = field(default_factory=Expressions)
    definition_signals: tuple[Signal, ...] = ()
    period: float = 0.0
    ticks: tuple[Tick, ...] = ()
    delays: Mapping[str, sp.Expr] = field(default_factory=Expressions)

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not re.fullmatch(r"[A-Za-z_]\w*", self.name):
            raise InputError(f"{self.name!r} is not a valid block name; use letters, digits and _")
        for kind in ("states", "inputs", "outputs", "parameters", "definition_signals"):
            signals = getattr(self, kind)
            if isinstance(signals, str | Signal) or not all(isinstance(s, Signal) for s in signals):
                raise InputError(self.where(f"{kind} must be a sequence of Signal, found {shown(signals)}"))
            object.__setattr__(self, kind, tuple(signals))
        for kind in ("derivatives", "output_expressions", "definitions", "delays"):
            if not isinstance(getattr(self, kind), Expressions):
                object.__setattr__(self, kind, Expressions(getattr(self, kind)))
        object.__setattr__(self, "ticks", tuple(self.ticks))
        check(self)

    # ---- what can be asked ---------------------------------------------------------------------------

    def where(self, text: str) -> str:
        """Return a text for an error, the Block's name in front."""
        return f"block {self.name!r}: {text}"

    def all_expressions(self) -> Iterator[tuple[str, sp.Expr]]:
        """Yield every expression and what texts call it."""
        yield from self.definitions.items()
        for name, expression in self.derivatives.items():
            yield self.update_text(name), expression
        for tick in self.ticks:
            yield from ((f"next {name}", expression) for name, expression in tick.updates.items())
        yield from self.output_expressions.items()

    @cached_property
    def n_continuous(self) -> int:
        """Number of states that no tick sets; they come first."""
        return len(self.states) - sum(len(tick.updates) for tick in self.ticks)

    def update_text(self, state: str) -> str:
        """Return how texts call what `derivatives` has of a state: ``u'``, or ``next mode`` if sampled."""
        return f"next {state}" if self.period else f"{state}'"

    def need_continuous(self, what: str, *, hybrid: bool = True) -> None:
        """Refuse a sampled Block where it has no such thing; raises :class:`InputError`.

        Parameters
        ----------
        what : str
            What it has not.
        hybrid : bool, optional
            Whether a hybrid Block has it.

        Raises
        ------
        InputError
            If the Block is sampled, or hybrid where that does not go.
        """
        if self.period:
            raise InputError(self.where(f"sampled every {self.period:g} s, it has no {what}"))
        if not hybrid:
            self.need_no_ticks(what)

    def need_no_ticks(self, what: str) -> None:
        """Refuse a hybrid Block, continuous in parts and sampled in parts; raises :class:`InputError`.

        Parameters
        ----------
        what : str
            What it has not; a continuous and a sampled Block have it.

        Raises
        ------
        InputError
            If the Block is hybrid.
        """
        if self.ticks:
            raise InputError(self.where(f"it has parts that tick and therefore no {what}"))

    def need_prompt_inputs(self, what: str) -> None:
        """Refuse a Block whose inputs act late where nothing remembers them; raises :class:`InputError`.

        Parameters
        ----------
        what : str
            What needs each input at the instant at which it acts.

        Raises
        ------
        InputError
            If an input acts late.
        """
        for name in self.delays:
            raise InputError(
                self.where(
                    f"the input {name!r} acts with a delay, which {what} does not support: give the inputs "
                    "as they arrive to hovercontrol.blocks.delays.undelayed(block), or approximate by "
                    "hovercontrol.blocks.delays.pade(block, order)"
                )
            )

    @checked
    def signal(self, name: str) -> Signal:
        """Return the state, input, parameter, output or definition of that name.

        Raises
        ------
        InputError
            If there is none; the nearest name is in the text.
        """
        groups = (self.states, self.inputs, self.parameters, self.outputs, self.definition_signals)
        every = {s.name: s for group in reversed(groups) for s in group}
        check_known(name, every, self.where(f"no signal {name!r}"))
        return every[name]

    def parameter_key(self, name: str) -> str:
        """Return the key in ``params`` of the parameter `name`, unique among Blocks: ``plant.thrust``."""
        return name if "." in name else f"{self.name}.{name}"

    @cached_property
    def default_parameters(self) -> dict[str, float]:
        """The value of every parameter, by its key."""
        return {self.parameter_key(p.name): p.start for p in self.parameters}

    def full_key(self, name: str) -> str:
        """Return the key of a parameter; other names as they are.

        Parameters
        ----------
        name : str
            Its key or, where unique, the last part, unless a state or input has that name (``thrust`` is the
            plant's input, ``plant.thrust`` its coefficient).

        Examples
        --------
        >>> from hovercontrol.craft.models.vehicles import vehicle
        >>> plant = vehicle("c17_simulation").plant()
        >>> plant.full_key("yaw_coulomb"), plant.full_key("thrust")
        ('plant.yaw_coulomb', 'thrust')
        """
        if name in self.default_parameters or any(name == s.name for s in (*self.states, *self.inputs)):
            return name
        return by_last_part(name, self.default_parameters)

    def full_state(self, name: str) -> str:
        """Return the name of a state given by its last part, where that is unique; other names as they are.

        Parameters
        ----------
        name : str

        Examples
        --------
        >>> import hovercontrol as hc
        >>> craft = hc.vehicle("c17_simulation")
        >>> loop = hc.interconnect([craft.plant(), hc.tracking_controller(craft), hc.circle(1.0, rate=0.7)])
        >>> loop.full_state("psi"), loop.full_state("nothing")
        ('plant.psi', 'nothing')
        """
        return by_last_part(name, [s.name for s in self.states])

    @checks_itself
    def parameter_values(
        self, params: Mapping[str, float] | None = None, *, bounded: bool = True
    ) -> tuple[float, ...]:
        """Return the values of all parameters in order, `params` over the defaults.

        Parameters
        ----------
        params : mapping, optional
            Values by key (``plant.yaw_coulomb``) or name (:meth:`full_key`).
        bounded : bool, optional
            Refuse values out of their bounds. Finite differences at a bound step over it.

        Raises
        ------
        InputError
            If a key is unknown (the nearest is named), a value is no number or out of its bounds.
        """
        usual = type(params) is dict and set(map(type, params)) <= {str}
        if params is not None and not usual and not fits(params, Mapping[str, Any]):
            text = f"params: expected names, each with a number, found {shown(params)}"
            raise InputError(self.where(text))
        values = dict(self.default_parameters)
        signals = dict(zip(values, self.parameters, strict=True))
        for name, value in (params or {}).items():
            key = name if name in values else self.full_key(name)
            check_known(key, values, self.where(f"unknown parameter {key!r}"))
            try:
                if type(value) is not float and not fits(value, float):
                    raise InputError(f"params[{key!r}]: expected a number, found {shown(value)}")
                values[key] = number = float(value)
                signal = signals[key]
                if bounded and not signal.lower <= number <= signal.upper:
                    values[key] = signal.check(number, key)
            except InputError as error:
                raise InputError(self.where(str(error))) from None
        return tuple(values.values())

    @checked
    def with_values(self, values: Mapping[str, float]) -> Block:
        """Return the Block with other start values of states, inputs or parameters.

        Parameters
        ----------
        values : mapping
            By signal name; parameters also by key or by its last part, where no state or input has that name
            (``thrust`` is the plant's input, ``plant.thrust`` its coefficient).

        Raises
        ------
        InputError
            If a name is unknown or a value out of its bounds.
        """
        keys = {self.parameter_key(p.name): p.name for p in self.parameters}
        left = {keys.get(self.full_key(name), name): value for name, value in values.items()}

        def changed(signals: tuple[Signal, ...]) -> tuple[Signal, ...]:
            return tuple(s.replace(start=left.pop(s.name)) if s.name in left else s for s in signals)

        new = {kind: changed(getattr(self, kind)) for kind in ("states", "inputs", "parameters")}
        if left:
            self.signal(next(iter(left)))
            raise InputError(
                self.where(f"{next(iter(left))!r} is an output or definition and has no start value")
            )
        return self.unchecked(**new)

    @checked
    def with_outputs(self, names: Sequence[str]) -> Block:
        """Return the Block with only these outputs; every backend then computes no others.

        Parameters
        ----------
        names : sequence of str
            Names of outputs, in the order wanted; may be empty.

        Raises
        ------
        InputError
            If a name is unknown or listed twice.

        Examples
        --------
        >>> x, y = Signal("x", "m"), Signal("y", "m")
        >>> both = Block("both", [], [x], [x, y], output_expressions={"y": 2 * x.symbol})
        >>> print(both.with_outputs(["y"]).equations())
        y = 2*x
        """
        chosen = tuple(names)
        if chosen not in self._chosen:
            own = {s.name: s for s in self.outputs}
            for k, name in enumerate(chosen):
                check_known(name, own, self.where(f"unknown output {name!r}"))
                if name in chosen[:k]:
                    raise InputError(self.where(f"the output {name!r} is listed twice"))
            self._chosen[chosen] = self.unchecked(
                outputs=tuple(own[name] for name in chosen),
                output_expressions=Expressions((name, self.output_expressions[name]) for name in chosen),
            )
        return self._chosen[chosen]

    @cached_property
    def _chosen(self) -> dict[tuple[str, ...], Block]:
        """The Blocks of :meth:`with_outputs` made before."""
        return {}

    @checked
    def parameter(self, name: str) -> Signal:
        """Return a parameter; `name` is its key (``plant.yaw_coulomb``) or, where unique, its last part.

        Raises
        ------
        InputError
            If there is none; the nearest is named.
        """
        every = {self.parameter_key(p.name): p for p in self.parameters}
        short = [p for key, p in every.items() if key.rpartition(".")[2] == name]
        if name in every or len(short) == 1:
            return every.get(name) or short[0]
        hint = did_you_mean(name, [*every, *(key.rpartition(".")[2] for key in every)])
        raise InputError(self.where(f"no parameter {name!r}{hint}"))

    def named(self, name: str) -> Block:
        """Return the Block under another name; its own parameters' keys follow."""
        own = f"{self.name}."
        moved = {
            p.name: f"{name}.{p.name.removeprefix(own)}" for p in self.parameters if p.name.startswith(own)
        }
        return replace(self.with_parameter_names(moved), name=name)

    def with_parameter_names(self, names: Mapping[str, str]) -> Block:
        """Return the Block with other names for some parameters, old to new."""
        swap = {sp.Symbol(a, real=True): sp.Symbol(b, real=True) for a, b in names.items()}
        parameters = tuple(p.replace(name=names.get(p.name, p.name)) for p in self.parameters)
        return replace(self, parameters=parameters, **self.swapped(swap))

    @cached_property
    def feedthrough(self) -> dict[str, tuple[str, ...]]:
        """For each output the inputs that act on it at the same instant, derived from the expressions."""
        inputs = {s.symbol: s.name for s in self.inputs}
        reach: dict[sp.Symbol, set[str]] = {symbol: {name} for symbol, name in inputs.items()}

        def of(expression: sp.Expr) -> set[str]:
            found = (reach.get(symbol, set()) for symbol in expression.free_symbols)
            return set().union(*found)

        for name, expression in self.definitions.items():
            reach[sp.Symbol(name, real=True)] = of(expression)
        return {
            name: tuple(i.name for i in self.inputs if i.name in of(expression))
            for name, expression in self.output_expressions.items()
        }

    def expand(self, expression: sp.Expr) -> sp.Expr:
        """Return an expression with all definitions written out."""
        for name, value in reversed(list(self.definitions.items())):
            expression = expression.xreplace({sp.Symbol(name, real=True): value})
        return expression

    def jacobian(self, rows: Rows = "derivatives", columns: Columns = "states") -> sp.ImmutableMatrix:
        """Return the exact partial derivatives, with definitions written out.

        Parameters
        ----------
        rows : {"derivatives", "outputs"}
        columns : {"states", "inputs", "parameters"}

        Returns
        -------
        sympy.ImmutableMatrix
            One row for each state (output), one column for each signal of that kind.

        Examples
        --------
        >>> v, k = Signal("v", "m/s"), Signal("k", "1/s")
        >>> Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol}).jacobian()
        Matrix([[-k]])
        """
        from hovercontrol.blocks.derivatives import partial_derivatives

        names = [s.name for s in getattr(self, columns)]
        shape = (len(getattr(self, "states" if rows == "derivatives" else "outputs")), len(names))
        entries = partial_derivatives(self, rows, names)
        return sp.ImmutableMatrix(*shape, lambda i, j: self.expand(entries.get((i, j), sp.S.Zero)))

    @cached_property
    def content_hash(self) -> str:
        """A hexadecimal digest of all that the Block says; the same in every process."""
        digest = hashlib.sha256(self.name.encode())
        for kind in fields(self):
            value = getattr(self, kind.name)
            if isinstance(value, Expressions):
                value = _exact(value)
            elif kind.name == "ticks":
                value = [(tick.name, tick.period, _exact(tick.updates)) for tick in value]
            digest.update(f"{kind.name}={value!r};".encode())
        return digest.hexdigest()

    def __repr__(self) -> str:
        return block_summary(self)

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def swapped(self, swap: Mapping[sp.Expr, sp.Expr]) -> dict[str, Any]:
        """Return all groups of expressions as fields of a new Block, the values of `swap` for its keys."""

        def group(expressions: Mapping[str, sp.Expr]) -> Expressions:
            return Expressions((name, e.xreplace(swap)) for name, e in expressions.items())

        fields_: dict[str, Any] = {
            kind: group(getattr(self, kind))
            for kind in ("derivatives", "definitions", "output_expressions", "delays")
        }
        return fields_ | {"ticks": tuple(replace(tick, updates=group(tick.updates)) for tick in self.ticks)}

    def unchecked(self, **changes: Any) -> Block:
        """Return a copy with `changes` of fields that are not checked, for code that derives Blocks."""
        block = object.__new__(Block)
        for f in fields(Block):
            object.__setattr__(block, f.name, changes.get(f.name, getattr(self, f.name)))
        return block


def _exact(expressions: Expressions) -> list[tuple[str, str]]:
    """Return expressions as texts that tell all of them: in a plain repr a table is its name alone."""
    return [(name, sp.srepr(expression)) for name, expression in expressions.items()]
