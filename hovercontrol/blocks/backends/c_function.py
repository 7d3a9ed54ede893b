"""Write a C function of a Block's signals: its loads, computations and assignments, at one or several points.

A function is built from array elements and expressions, not from text. So the same function can be written
for one point, ``state[3]``, and for HC_LANES points computed in parallel, ``state[3 * HC_LANES + l]``.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import sympy as sp

from hovercontrol.blocks.backends.c_loops import Loops, Statement
from hovercontrol.blocks.backends.c_nests import COUNTERS
from hovercontrol.blocks.backends.c_printer import CPrinter, identifier
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.expressions import with_symbols
from hovercontrol.blocks.friction import DryFriction
from hovercontrol.blocks.program import Program, equations
from hovercontrol.blocks.signals import Signal, time

#: Names that a local variable must not have: C99's keywords, our arrays, and names of math.h.
_TAKEN = frozenset(
    (  # noqa: SIM905
        "auto break case char const continue default do double else enum extern float for goto if inline int "
        "long register restrict return short signed sizeof static struct switch typedef union unsigned void "
        "volatile while main j0 j1 jn y0 y1 yn gamma exp log pow sin cos tan asin acos atan atan2 sinh cosh "
        "tanh sqrt fabs fmax fmin floor ceil round erf div abs signum time "
        "t state input param mode dx out a b value at next l k tick"
    ).split()
).union(COUNTERS)

#: Functions of more statements than this are written as loops: straight code of 80 bytes for each then fills
#: an instruction cache of 32 kB.
LONG = 400

#: Arguments of a function of hc_model.h at one point: types and names.
POINT = (
    *(("double ", "t"), ("const double *", "state"), ("const double *", "input")),
    *(("const double *", "param"), ("const int *", "mode")),
)


@dataclass(frozen=True)
class Element:
    """An array element; in functions for several points there is one per point (lane)."""

    array: str
    place: int

    def text(self, lanes: bool = False) -> str:
        """Return the element as C source."""
        return f"{self.array}[{self.place} * HC_LANES + l]" if lanes else f"{self.array}[{self.place}]"


@dataclass(frozen=True)
class Result:
    """An assignment ``target = expression``; if `mode` is given and is 0, the velocity sticks: target = 0."""

    target: Element
    expression: sp.Expr
    remark: str = ""
    mode: Element | None = None


class Names:
    """Unique C identifiers of a Block's symbols, and the array elements that hold the symbols.

    Parameters
    ----------
    frictions : sequence of DryFriction, optional
        Dry frictions; their modes are symbols, too.

    Attributes
    ----------
    of : dict of sympy.Symbol to str
    load : dict of sympy.Symbol to (Element, str)
        Array element that holds a symbol, and the text of its comment.
    taken : set of str
    """

    def __init__(self, block: Block, frictions: Sequence[DryFriction] = ()) -> None:
        self.of: dict[sp.Symbol, str] = {time: "t"}
        self.load: dict[sp.Symbol, tuple[Element, str]] = {}
        self.taken = set(_TAKEN)
        for array, group in (("state", block.states), ("input", block.inputs), ("param", block.parameters)):
            for k, signal in enumerate(group):
                self._add(signal.symbol)
                self.load[signal.symbol] = (Element(array, k), remark(signal))
        for k, f in enumerate(frictions):
            self._add(f.symbol)
            self.load[f.symbol] = (Element("mode", k), f"sgn of {f.state} in its mode")
        for name in block.definitions:
            self._add(sp.Symbol(name, real=True))

    def _add(self, symbol: sp.Symbol) -> None:
        name = identifier(symbol.name, self.taken)
        self.taken.add(name)
        self.of[symbol] = name

    def program(self, program: Program) -> dict[sp.Symbol, sp.Symbol]:
        """Return all symbols of a program as symbols whose names are C identifiers."""
        found = dict(self.of)
        k = 0
        for symbol, _ in program.steps:
            if symbol not in found:
                while f"c{k}" in self.taken:
                    k += 1
                found[symbol] = f"c{k}"
                k += 1
        return {symbol: sp.Symbol(name, real=True) for symbol, name in found.items()}


def remark(signal: Signal) -> str:
    """Return the comment on a signal: name, unit and description."""
    text = f"{signal.name} [{signal.unit}] {signal.description}".strip()
    return text.replace("*/", "* /")


class Function:
    """A C function that computes results and assigns them.

    Parameters
    ----------
    branches : bool, optional
        If false, all values that a condition selects are computed beforehand, and there are no sticking
        modes.

    Attributes
    ----------
    uses : set of str
        Names of the arguments that the function uses.
    """

    def __init__(
        self, block: Block, names: Names, results: Sequence[Result], *, branches: bool = True
    ) -> None:
        self._steps: list[tuple[str, str, str]] = []
        self._results: list[tuple[Result, str]] = []
        self._looped: list[str] = []
        self.uses = {r.target.array for r in results} | {r.mode.array for r in results if r.mode}
        definitions, values = equations(block, [r.expression for r in results])
        if branches and len(definitions) + len(values) > LONG:
            used = self._write_loops(names, definitions, results, values)
        else:
            used = self._write(block, names, results, branches)
        self._loads = [
            (names.of[symbol], element, text)
            for symbol, (element, text) in names.load.items()
            if symbol in used
        ]
        self.uses |= {element.array for _, element, _ in self._loads} | ({"t"} if time in used else set())

    def _write(self, block: Block, names: Names, results: Sequence[Result], branches: bool) -> set[sp.Symbol]:
        """Write all statements one after the other; return their symbols."""
        program = Program(block, [r.expression for r in results])
        if not branches:
            program = program.without_branches()
        short, printer = names.program(program), CPrinter()
        for symbol, e in program.steps:
            note = f" /* {symbol.name} */" if symbol.name in block.definitions else ""
            self._steps.append((short[symbol].name, printer.doprint(with_symbols(e, short)), note))
        self._results = [
            (result, printer.doprint(with_symbols(e, short)))
            for result, e in zip(results, program.results, strict=True)
        ]
        return program.symbols

    def _write_loops(
        self,
        names: Names,
        definitions: Mapping[str, sp.Expr],
        results: Sequence[Result],
        values: Sequence[sp.Expr],
    ) -> set[sp.Symbol]:
        """Write loops and other statements; return the symbols outside loops."""
        loads = {symbol: (e.array, e.place) for symbol, (e, _) in names.load.items()}
        statements = []
        for r, e in zip(results, values, strict=True):
            if r.mode:
                mode = sp.Symbol(r.mode.text(), real=True)
                loads[mode] = r.mode.array, r.mode.place
                e = sp.Piecewise((e, sp.Ne(mode, 0)), (sp.S.Zero, True), evaluate=False)
            statements.append(Statement(r.target.array, r.target.place, e, r.remark))
        loops = Loops(definitions, statements, loads, names.of, names.taken)
        self._looped = loops.lines
        self.uses |= loops.arrays
        return loops.symbols

    def lines(self, lanes: bool = False) -> list[str]:
        """Return the statements of the function, for one point or for lane ``l``."""
        lines = [f"const double {name} = {at.text(lanes)}; /* {text} */" for name, at, text in self._loads]
        lines += [f"const double {name} = {text};{note}" for name, text, note in self._steps]
        lines += self._looped
        for result, text in self._results:
            whole = f"{result.mode.text(lanes)} != 0 ? {text} : 0.0" if result.mode else text
            note = f" /* {result.remark} */" if result.remark else ""
            lines.append(f"{result.target.text(lanes)} = {whole};{note}")
        return lines

    def unused(self, names: Iterable[str]) -> list[str]:
        """Return ``(void)`` statements for unused arguments, which avoid compiler warnings."""
        return [f"(void){name};" for name in names if name not in self.uses]

    def text(self, name: str, *targets: str, arguments: Sequence[tuple[str, str]] = POINT) -> str:
        """Return the complete function for one point.

        Parameters
        ----------
        *targets : str
            Arrays for the results, the last arguments of the function.
        arguments : sequence of (str, str), optional
            Types and names of the other arguments.
        """
        head = f"static void {name}("
        signature = head + ", ".join(f"{kind}{argument}" for kind, argument in arguments)
        target = ", ".join(f"double *restrict {name}" for name in targets)
        gap = " " if len(signature) + len(target) < 110 else "\n" + " " * len(head)
        body = [*self.unused([*(argument for _, argument in arguments), *targets]), *self.lines()]
        return "\n".join([f"{signature},{gap}{target})", "{", *(f"    {line}" for line in body), "}"])
