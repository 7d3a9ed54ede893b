"""The gate of public functions: what a script gives is checked before anything is done with it.

What an argument must be is said once, by its annotation. :func:`checked` compares each argument with it and
refuses in one line that names the function, the argument, what was expected and what was found; a value of
one of the usual types passes after one look into a set.
"""

from __future__ import annotations

import ast
import functools
import inspect
import re
import sys
import typing
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Literal, TypeVar

import numpy as np

from hovercontrol.core.annotations import LOOKED_AT, described, fits, innermost, usual_types
from hovercontrol.errors import InputError, did_you_mean, shown

Thing = TypeVar("Thing", bound=Callable[..., Any])

#: What Python and NumPy raise where a number, a size or a shape is not one to calculate with.
_STUMBLES = (
    TypeError,
    ValueError,
    AttributeError,
    LookupError,
    ArithmeticError,
    NotImplementedError,
    MemoryError,
)


def checked(thing: Thing) -> Thing:
    """Make a public function, or a class's constructor and methods, refuse arguments of a wrong type.

    Parameters
    ----------
    thing : function or class

    Returns
    -------
    function or class
        The same; an argument of another type than its annotation raises :class:`.InputError`: the function,
        the argument, what was expected and what was found, in one line. So does a number with which it cannot
        calculate (NaN, infinite, or an empty array) where it stumbles over it.

    Examples
    --------
    >>> @checked
    ... def turn(rate: float, times: int = 1) -> float:
    ...     return rate / times
    >>> turn("fast")
    Traceback (most recent call last):
        ...
    hovercontrol.errors.InputError: turn: rate: expected a number, found 'fast'
    """
    if not inspect.isclass(thing):
        label = thing.__qualname__.rpartition("<locals>.")[2]
        return typing.cast(Thing, _Gate(thing, label, bound="." in label).function())
    for name, body in list(vars(thing).items()):
        maker = name in ("__init__", "__new__")
        inner = body.__func__ if isinstance(body, classmethod | staticmethod) else body
        done = hasattr(inner, "__checked__") or not inspect.isfunction(inner)
        if not done and (maker or not name.startswith("_")):
            label = thing.__name__ if maker else f"{thing.__name__}.{name}"
            gate = _Gate(inner, label, bound=not isinstance(body, staticmethod) or maker)
            if gate.parameters:
                guarded = gate.function()
                setattr(thing, name, guarded if inner is body else type(body)(guarded))
    return thing


class _Gate:
    """What the arguments of one function must be, read from its annotations when it is first called."""

    def __init__(self, function: Callable[..., Any], name: str, bound: bool = False) -> None:
        self.inner, self.name = function, name
        found = list(inspect.signature(function).parameters.values())[bound:]
        self.parameters = {one.name: one for one in found}
        self.skipped = int(bound)
        self.hints: dict[str, Any] = {}

    def function(self) -> Callable[..., Any]:
        inner, skipped = self.inner, self.skipped
        usual: dict[str, frozenset[type]] = {}
        order: list[str] = []
        rest, ready = "", False

        @functools.wraps(inner)
        def guard(*args: Any, **kwargs: Any) -> Any:
            nonlocal rest, ready
            if not ready:
                self.hints = self._read()
                usual.update({key: usual_types(hint) for key, hint in self.hints.items()})
                order[:] = self._positions()
                rest = next((p.name for p in self._of(inspect.Parameter.VAR_POSITIONAL)), "")
                ready = True
            for k in range(skipped, len(args)):
                key = order[k - skipped] if k - skipped < len(order) else rest
                if key in usual and type(args[k]) not in usual[key]:
                    self._look(key, args[k])
            for key, value in kwargs.items():
                if key in usual and type(value) not in usual[key]:
                    self._look(key, value)
            try:
                return inner(*args, **kwargs)
            except InputError:
                raise
            except _STUMBLES as error:
                self._blame(error, args, kwargs)
                raise

        guard.__checked__ = True  # type: ignore[attr-defined]
        return guard

    def _of(self, *kinds: Any) -> Iterator[inspect.Parameter]:
        return (one for one in self.parameters.values() if one.kind in kinds)

    def _positions(self) -> list[str]:
        kinds = inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD
        return [one.name for one in self._of(*kinds)]

    def _read(self) -> dict[str, Any]:
        """Return the annotations of arguments."""
        found, names = {}, inspect.unwrap(self.inner).__globals__
        for key, parameter in self.parameters.items():
            hint = parameter.annotation
            if parameter.kind is inspect.Parameter.VAR_KEYWORD or hint is inspect.Parameter.empty:
                continue  # names that the function itself knows
            try:
                found[key] = eval(hint, names) if isinstance(hint, str) else hint
            except NameError:
                found[key] = eval(hint, names, names_for_checkers(self.inner.__module__))
        return found

    def _look(self, key: str, value: Any) -> None:
        if value is not self.parameters[key].default and not fits(value, self.hints[key]):
            where, part, hint = innermost(key, value, self.hints[key])
            nearest = ""
            if typing.get_origin(hint) is Literal and isinstance(part, str):
                nearest = did_you_mean(part, typing.get_args(hint))
                nearest = "" if nearest.startswith("; known") else nearest  # all are named already
            expected = described(hint)
            raise InputError(f"{self.name}: {where}: expected {expected}, found {shown(part)}{nearest}")

    def _blame(self, error: Exception, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
        """Raise an error of one line where nothing can be calculated with a number, a size or a shape."""
        given = dict(zip(self._positions(), args[self.skipped :], strict=False)) | dict(kwargs)
        try:
            inspect.signature(self.inner).bind(*args, **kwargs)
        except TypeError:
            return  # Python says which argument is too much or missing
        for one in self._of(inspect.Parameter.VAR_POSITIONAL):
            given[one.name] = args[self.skipped + len(self._positions()) :]
        given = {k: v for k, v in given.items() if k in self.hints and v is not self.parameters[k].default}
        for key, value in given.items():
            fault = fault_of(value)
            if not fault and self.hints[key] is int and value < 0:
                fault = "zero or more"
            if fault:
                raise InputError(f"{self.name}: {key}: expected {fault}, found {shown(value)}") from error
        if _ABOUT_SHAPES.search(str(error)):
            arrays = {k: v for k, v in given.items() if described(self.hints[k]).startswith("numbers")}
            shapes = {k: np.shape(v) for k, v in arrays.items() if v is not None}
            if shapes:
                found = ", ".join(f"{key} {shape}" for key, shape in shapes.items())
                raise InputError(f"{self.name}: expected shapes that go together, found {found}") from error


#: What Python and NumPy say where shapes do not go together.
_ABOUT_SHAPES = re.compile(
    r"shape|broadcast|dimension|ax[ie]s|0-d|unsized|no len|ndim|not subscriptable|not iterable|out of bounds"
    r"|index|reshape|concatenate|zip\(\)|homogeneous|not match|same length"
)


@functools.cache
def names_for_checkers(module: str) -> dict[str, Any]:
    """Return what a module imports ``if TYPE_CHECKING`` alone: annotations name it, running code does not.

    Examples
    --------
    >>> names_for_checkers("hovercontrol.analysis.common.regions")["pyarrow"].__name__
    'pyarrow'
    """
    names: dict[str, Any] = {}
    found = sys.modules[module]
    body = ast.parse(inspect.getsource(found)).body
    guarded = [
        one for one in body if isinstance(one, ast.If) and ast.unparse(one.test).endswith("TYPE_CHECKING")
    ]
    for one in guarded:
        exec(compile(ast.Module(one.body, []), module, "exec"), dict(vars(found)), names)
    return names


#: Largest number whose square is one.
LARGEST = 1e150


def fault_of(value: Any) -> str:
    """Return what a value lacks to be calculated with, as an error line says it; else an empty text.

    Examples
    --------
    >>> fault_of([1.0, float("nan")]), fault_of([]), fault_of(2.0)
    ('finite numbers', 'at least one value', '')
    """
    if isinstance(value, Mapping):
        return next(filter(None, map(fault_of, list(value.values())[:LOOKED_AT])), "")
    if isinstance(value, str | bytes) or value is None:
        return ""
    if isinstance(value, np.ndarray | list | tuple) and np.size(value) == 0:
        return "at least one value"
    try:
        numbers = np.asarray(value, dtype=float)
    except OverflowError:
        return "numbers of a usual size"
    except (TypeError, ValueError):
        return ""
    if not np.all(np.isfinite(numbers)):
        return "finite numbers" if numbers.ndim else "a finite number"
    return "numbers of a usual size" if np.any(np.abs(numbers) > LARGEST) else ""
