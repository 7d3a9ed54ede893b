"""Compare values with type annotations: does a value match, which part does not, how messages name it."""

from __future__ import annotations

import inspect
import os
import types
import typing
from collections.abc import Callable, Iterable, Mapping
from itertools import islice
from numbers import Integral, Real
from pathlib import Path
from typing import Any, Literal, TypeVar, Union

import numpy as np
import numpy.typing as npt
import sympy as sp

#: Maximum number of elements of a sequence that are checked; arrays are checked as a whole.
LOOKED_AT = 1000

_UNIONS = (Union, types.UnionType)


#: ``ArrayLike`` is a named type in some versions of NumPy and a union in others. In a larger union, the
#: members of that union merge with the others. The members are private to NumPy.
_MEMBERS = frozenset(typing.get_args(npt.ArrayLike))
#: The most frequent types; a value of one of these types always matches an annotation of the same type.
_PLAIN = frozenset([float, str, int, bool])


def _meant(hint: Any) -> Any:
    """Resolve a named annotation; NumPy's ``ArrayLike`` becomes ``np.ndarray``."""
    if hint is npt.ArrayLike:
        return np.ndarray
    if inspect.isclass(hint):
        return hint
    while hint != npt.ArrayLike and hasattr(hint, "__value__"):
        hint = hint.__value__
    return np.ndarray if hint == npt.ArrayLike else hint


def fits(value: Any, hint: Any) -> bool:
    """Return whether a value matches an annotation, or converts to it unambiguously."""
    if hint is type(value) and hint in _PLAIN:
        return True
    hint = _meant(hint)
    if hint is np.ndarray:
        return _is_numbers(value)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint in (Any, object, inspect.Parameter.empty) or isinstance(hint, TypeVar | str):
        return True
    if hint is None or hint is type(None):
        return value is None
    if _is_array(hint):
        return _is_numbers(value)
    if origin in _UNIONS:
        return any(fits(value, one) for one in _parts(inner))
    if origin is Literal:
        return any(type(value) is type(one) and value == one for one in inner)
    return _fits_class(value, hint) if origin is None else _fits_generic(value, origin, inner)


def _fits_class(value: Any, hint: Any) -> bool:
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
    if not inspect.isclass(hint):
        return True
    if issubclass(hint, sp.MatrixBase):
        return isinstance(value, sp.MatrixBase)  # mutable or not
    if issubclass(hint, sp.Basic):
        return isinstance(value, sp.Basic | Real)
    if getattr(hint, "_is_protocol", False):
        return all(hasattr(value, name) for name in vars(hint) if not name.startswith("_"))
    return isinstance(value, hint)


def _fits_generic(value: Any, origin: Any, inner: tuple[Any, ...]) -> bool:
    if origin is type:
        return inspect.isclass(value)
    if not inspect.isclass(origin):
        return True
    if issubclass(origin, Callable):  # type: ignore[arg-type]
        return callable(value)
    if issubclass(origin, Mapping):
        if isinstance(value, Mapping):
            pairs = islice(value.items(), LOOKED_AT)
            return all(fits(k, inner[0]) and fits(v, inner[1]) for k, v in pairs)
        return hasattr(value, "keys") and hasattr(value, "__getitem__")  # a data frame
    if issubclass(origin, Iterable):
        return _fits_sequence(value, origin, inner)
    return isinstance(value, origin)


def _fits_sequence(value: Any, origin: Any, inner: tuple[Any, ...]) -> bool:
    if isinstance(value, str | bytes | Mapping) or not isinstance(value, Iterable):
        return False
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return False
    kinds = [one for one in inner if one is not Ellipsis]
    readable = isinstance(value, list | tuple | range | np.ndarray | set)  # others, once read, are empty
    few = list(islice(value, LOOKED_AT)) if readable else []
    if origin is tuple and len(kinds) > 1 and Ellipsis not in inner:
        return len(few) == len(kinds) and all(map(fits, few, kinds))
    return not kinds or all(fits(one, kinds[0]) for one in few)


def _parts(inner: tuple[Any, ...]) -> list[Any]:
    """Return the members of a union; those of ``ArrayLike`` together count as one, ``np.ndarray``."""
    flat: list[Any] = []
    if _MEMBERS and set(inner) >= _MEMBERS:
        flat, inner = [np.ndarray], tuple(one for one in inner if one not in _MEMBERS)
    for one in map(_meant, inner):
        flat += _parts(typing.get_args(one)) if typing.get_origin(one) in _UNIONS else [one]
    return flat


def alternatives(hint: Any) -> tuple[Any, ...]:
    """Return the members of an annotation that is a union, else the annotation; a value must fit one of them.

    Examples
    --------
    >>> alternatives(float | None)
    (<class 'float'>, <class 'NoneType'>)
    """
    meant = _meant(hint)
    return tuple(_parts(typing.get_args(meant))) if typing.get_origin(meant) in _UNIONS else (meant,)


def _is_array(hint: Any) -> bool:
    return hint is np.ndarray or typing.get_origin(hint) is np.ndarray


def _is_numbers(value: Any) -> bool:
    if isinstance(value, np.ndarray) and value.dtype.kind in "biuf":
        return True
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
    """Return the type of an annotation in the words of an error message.

    Examples
    --------
    >>> described(float | None), described(dict[str, float]), described(Literal["zero", "linear"])
    ('a number or None', 'names, each with a number', "'zero' or 'linear'")
    """
    hint = _meant(hint)
    origin, inner = typing.get_origin(hint), typing.get_args(hint)
    if hint is None or hint is type(None):
        return "None"
    if _is_array(hint):
        return "numbers"
    if origin in _UNIONS:
        return " or ".join(dict.fromkeys(described(one) for one in _parts(inner)))
    if origin is Literal:
        return " or ".join(map(repr, inner))
    if inspect.isclass(origin) and issubclass(origin, Mapping):
        return f"names, each with {described(inner[1])}"
    if origin is not None and inspect.isclass(origin) and issubclass(origin, Iterable):
        kinds = [described(one) for one in inner if one is not Ellipsis]
        if origin is tuple and Ellipsis not in inner and len(set(kinds)) == 1:
            return f"{len(kinds)} values, each {kinds[0]}"
        return f"a sequence, each {kinds[0]}" if kinds else "a sequence"
    if hint in _WORDS:
        return _WORDS[hint]
    if origin is not None:
        return "a function" if origin.__name__ == "Callable" else f"a {origin.__name__}"
    name = getattr(hint, "__name__", str(hint))
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"


def innermost(where: str, value: Any, hint: Any) -> tuple[str, Any, Any]:
    """Return the part of an argument that does not match its annotation: place, value, expected annotation.

    Examples
    --------
    >>> innermost("params", {"k": 1.0, "m": "heavy"}, dict[str, float])[:2]
    ("params['m']", 'heavy')
    """
    hint = _meant(hint)
    for kind in _parts(typing.get_args(hint)) if typing.get_origin(hint) in _UNIONS else [hint]:
        origin, inner = typing.get_origin(kind), typing.get_args(kind)
        if not inspect.isclass(origin) or not inner:
            continue
        if issubclass(origin, Mapping):
            if not isinstance(value, Mapping) or not all(fits(k, inner[0]) for k in value):
                continue
            wrong = next(k for k, v in value.items() if not fits(v, inner[1]))
            return innermost(f"{where}[{wrong!r}]", value[wrong], inner[1])
        elif issubclass(origin, Iterable) and isinstance(value, list | tuple):
            fixed = origin is tuple and Ellipsis not in inner
            if fixed and len(value) != len(inner):
                continue
            kinds = inner if fixed else inner[:1] * len(value)
            place = next((k for k, v in enumerate(value) if not fits(v, kinds[k])), None)
            if place is not None:
                return innermost(f"{where}[{place}]", value[place], kinds[place])
    return where, value, hint


def usual_types(hint: Any) -> frozenset[type]:
    """Return types whose values all match an annotation."""
    hint = _meant(hint)
    if hint in _USUAL:
        return _USUAL[hint]
    if typing.get_origin(hint) in _UNIONS:
        return frozenset().union(*map(usual_types, _parts(typing.get_args(hint))))
    plain = inspect.isclass(hint) and typing.get_origin(hint) is None
    return frozenset([hint]) if plain and hint is not np.ndarray else frozenset()


_USUAL: dict[Any, frozenset[type]] = {
    float: frozenset([float, np.float64]),
    int: frozenset([int, np.int64]),
    Path: frozenset([str, type(Path())]),
    None: frozenset([type(None)]),
    object: frozenset(),
}
