"""Checks of arguments from a user's script: an error names the argument.

What a function checks itself is said in its own words. Where it stumbles over a type nobody thought of, one
helper looks at what the annotations expect; a call that is right costs nothing.
"""

from __future__ import annotations

import functools
import inspect
import os
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

import numpy as np
import numpy.typing as npt
import sympy as sp

from hovercontrol.errors import InputError, shown

Thing = TypeVar("Thing", bound=Callable[..., Any])

#: What Python raises where something is of a wrong type.
_STUMBLES = (TypeError, ValueError, AttributeError, LookupError, ArithmeticError, NotImplementedError)

#: Most elements of a sequence that are looked at; arrays are looked at as a whole.
LOOKED_AT = 1000

_ARRAY = frozenset(typing.get_args(npt.ArrayLike))


def checked(thing: Thing) -> Thing:
    """Make a public function, or a class's constructor, name the wrong argument in its error.

    Parameters
    ----------
    thing : function or class

    Returns
    -------
    function or class
        The same; where an argument of another type than its annotation makes it stumble, it raises
        :class:`.InputError`: the function, the argument, what was expected and what was found, in one line.

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
    if inspect.isclass(thing):
        thing.__init__ = _guarded(thing.__init__, thing.__name__)  # type: ignore[method-assign]
        return thing
    return typing.cast(Thing, _guarded(thing, thing.__name__))


def _guarded(function: Callable[..., Any], name: str) -> Callable[..., Any]:
    signature = inspect.signature(function)
    hints: dict[str, Any] = {}

    @functools.wraps(function)
    def guard(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except InputError:
            raise
        except _STUMBLES as error:
            try:
                given = signature.bind(*args, **kwargs).arguments
            except TypeError:
                raise error from None  # Python says which argument is too much or missing
            if not hints:
                hints.update(_hints(function, signature))
            for key, value in given.items():
                own = signature.parameters[key].default
                if key in hints and value is not own and not fits(value, hints[key]):
                    text = f"{name}: {key}: expected {described(hints[key])}, found {shown(value)}"
                    raise InputError(text) from error
            raise

    return guard


def _hints(function: Callable[..., Any], signature: inspect.Signature) -> dict[str, Any]:
    """Return the annotations of arguments; those that only a type checker knows are left out."""
    found: dict[str, Any] = {"": Any}
    names = function.__globals__
    for key, parameter in signature.parameters.items():
        if parameter.kind in (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD):
            continue  # each of these says itself what it expects
        hint = parameter.annotation
        try:
            found[key] = eval(hint, names) if isinstance(hint, str) else hint
        except NameError:
            continue
    return found


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
        return number and not isinstance(value, bool) and _is_numbers(value)
    if hint is int:
        return isinstance(value, Integral) and not isinstance(value, bool)
    if hint is bool:
        return isinstance(value, bool | np.bool_)
    if hint is Path:
        return isinstance(value, str | os.PathLike)
    if inspect.isclass(hint) and issubclass(hint, sp.Basic):
        return isinstance(value, sp.Basic | Real)
    return not inspect.isclass(hint) or getattr(hint, "_is_protocol", False) or isinstance(value, hint)


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
        few = list(value)[:LOOKED_AT] if isinstance(value, list | tuple | set | range | np.ndarray) else []
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
