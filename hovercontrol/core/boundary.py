"""The gate of public functions: what a script gives is checked before anything is done with it.

What an argument must be is said once, by its annotation. :func:`checked` compares each argument with it and
refuses in one line that names the function, the argument, what was expected and what was found; a value of
one of the usual types passes after one look into a set.
"""

from __future__ import annotations

import ast
import functools
import inspect
import os
import re
import sys
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

import numpy as np
import numpy.typing as npt
import sympy as sp

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

#: Most elements of a sequence that are looked at; arrays are looked at as a whole.
LOOKED_AT = 1000

_ARRAY = frozenset(typing.get_args(npt.ArrayLike))


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
                usual.update({key: _usual(hint) for key, hint in self.hints.items()})
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
            hint = self.hints[key]
            known = typing.get_args(hint) if typing.get_origin(hint) is Literal else ()
            nearest = did_you_mean(value, known) if known and isinstance(value, str) else ""
            if nearest.startswith("; known"):
                nearest = ""  # all of them are named already
            expected = described(hint)
            raise InputError(f"{self.name}: {key}: expected {expected}, found {shown(value)}{nearest}")

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


def _usual(hint: Any) -> frozenset[type]:
    """Return types of which every value is what an annotation says."""
    if hint in _USUAL:
        return _USUAL[hint]
    if typing.get_origin(hint) in (Union, types.UnionType):
        return frozenset().union(*map(_usual, _parts(typing.get_args(hint))))
    plain = inspect.isclass(hint) and typing.get_origin(hint) is None
    return frozenset([hint]) if plain and hint is not np.ndarray else frozenset()


_USUAL: dict[Any, frozenset[type]] = {
    float: frozenset([float, np.float64]),
    int: frozenset([int, np.int64]),
    Path: frozenset([str, type(Path())]),
    None: frozenset([type(None)]),
    object: frozenset(),
}


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value is what an annotation says, or can be made so without a guess."""
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in (Any, object, inspect.Parameter.empty) or isinstance(hint, TypeVar | str):
        return True
    if hint is None or hint is type(None):
        return value is None
    if _is_array(hint):
        return _is_numbers(value)
    if origin in (Union, types.UnionType):
        return any(fits(value, one) for one in _parts(inner))
    if origin is Literal:
        return any(type(value) is type(one) and value == one for one in inner)
    if origin is not None:
        return _fits_generic(value, origin, inner)
    if hint is float:
        number = isinstance(value, Real) or (isinstance(value, sp.Expr) and value.is_extended_real is True)
        number = number or (isinstance(value, np.ndarray) and value.ndim == 0)
        return number and not isinstance(value, bool) and _is_numbers(value)
    if hint is int:
        return isinstance(value, Integral) and not isinstance(value, bool)
    if hint is bool:
        return isinstance(value, bool | np.bool_)
    if hint is Path:
        return isinstance(value, str | os.PathLike)
    if inspect.isclass(hint) and issubclass(hint, sp.Basic):
        return isinstance(value, sp.Basic | Real)
    if getattr(hint, "_is_protocol", False):
        return all(hasattr(value, name) for name in vars(hint) if not name.startswith("_"))
    return not inspect.isclass(hint) or isinstance(value, hint)


def _fits_generic(value: Any, origin: Any, inner: tuple[Any, ...]) -> bool:
    if origin is type:
        return inspect.isclass(value)
    if not inspect.isclass(origin):
        return True
    if issubclass(origin, Callable):  # type: ignore[arg-type]
        return callable(value)
    if issubclass(origin, Mapping):
        pairs = isinstance(value, Mapping) and list(value.items())[:LOOKED_AT]
        return pairs is not False and all(fits(k, inner[0]) and fits(v, inner[1]) for k, v in pairs)
    if issubclass(origin, Iterable):
        if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
            return False
        if isinstance(value, np.ndarray) and value.ndim == 0:
            return False
        kinds = [one for one in inner if one is not Ellipsis]
        few: list[Any] = []
        if isinstance(value, list | tuple | range | np.ndarray):
            few = list(value[:LOOKED_AT])
        elif isinstance(value, set):
            few = list(value)[:LOOKED_AT]
        if origin is tuple and len(kinds) > 1 and Ellipsis not in inner:
            return len(few) == len(kinds) and all(map(fits, few, kinds))
        return not kinds or all(fits(one, kinds[0]) for one in few)
    return isinstance(value, origin)


def _parts(inner: tuple[Any, ...]) -> list[Any]:
    """Return what a union is of; what NumPy calls like an array is one part."""
    if not set(inner) >= _ARRAY:
        return list(inner)
    return [np.ndarray, *(one for one in inner if one not in _ARRAY)]


def _is_array(hint: Any) -> bool:
    return hint is np.ndarray or typing.get_origin(hint) is np.ndarray


def _is_numbers(value: Any) -> bool:
    if value is None or isinstance(value, str | bytes | Mapping | set):
        return False
    try:
        kind = np.asarray(value).dtype.kind
        np.asarray(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        return False
    return kind in "biuf" or (kind == "O" and np.size(value) > 0) or np.size(value) == 0


_WORDS = {float: "a number", int: "a whole number", bool: "true or false", str: "a text", Path: "a path"}


def described(hint: Any) -> str:
    """Return the type of an annotation as error lines name it.

    Examples
    --------
    >>> described(float | None), described(dict[str, float]), described(Literal["zero", "linear"])
    ('a number or None', 'names, each with a number', "'zero' or 'linear'")
    """
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is None or hint is type(None):
        return "None"
    if _is_array(hint):
        return "numbers"
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(described(one) for one in _parts(inner)))
    if origin is Literal:
        return " or ".join(map(repr, inner))
    if inspect.isclass(origin) and issubclass(origin, Mapping):
        return f"names, each with {described(inner[1])}"
    if origin is not None and inspect.isclass(origin) and issubclass(origin, Iterable):
        kinds = [described(one) for one in inner if one is not Ellipsis]
        return f"a sequence, each {kinds[0]}" if kinds else "a sequence"
    if hint in _WORDS:
        return _WORDS[hint]
    if origin is not None:
        return "a function" if origin.__name__ == "Callable" else f"a {origin.__name__}"
    name = getattr(hint, "__name__", str(hint))
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
