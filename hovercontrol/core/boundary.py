"""The gate of public functions: what a script gives is checked before anything is done with it.

What an argument must be is said once, by its annotation. :func:`checked` compares each argument with it and
refuses in one line that names the function, the argument, what was expected and what was found; a value of
one of the usual types passes after one look into a set.

Only who calls from outside the package gets an :class:`.InputError`. A wrong argument of the package's own
calls is a fault of the package, a ``TypeError``, and any other error of the package passes as it is.
"""

from __future__ import annotations

import ast
import functools
import inspect
import os
import sys
import sysconfig
import typing
from collections.abc import Callable, Iterator, Mapping
from numbers import Real
from pathlib import Path
from types import FrameType
from typing import Any, Literal, TypeVar

import numpy as np

from hovercontrol.core.annotations import LOOKED_AT, described, fits, innermost, usual_types
from hovercontrol.errors import InputError, did_you_mean, shown

Thing = TypeVar("Thing", bound=Callable[..., Any])

#: What Python and NumPy raise where a number is not one to calculate with.
_STUMBLES = ValueError, ArithmeticError, IndexError, MemoryError

_PACKAGE = str(Path(__file__).parents[1]) + os.sep
_LIBRARIES = tuple({sysconfig.get_path(name) + os.sep for name in ("stdlib", "purelib", "platlib")})


def checked(thing: Thing, name: str = "") -> Thing:
    """Make a public function, or a class's constructor and methods, refuse arguments of a wrong type.

    Parameters
    ----------
    thing : function or class
    name : str, optional
        What error lines call a class; default: its own name.

    Returns
    -------
    function or class
        The same; an argument of another type than its annotation raises :class:`.InputError`: the function,
        the argument, what was expected and what was found, in one line. So does a number with which it cannot
        calculate (NaN, infinite, or an empty array) where it stumbles over it. Both are for calls from
        outside the package: a wrong argument from inside raises ``TypeError``, and no error is explained.

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
    owner = name or thing.__name__
    for key, body in list(vars(thing).items()):
        maker = key in ("__init__", "__new__")
        inner = body.__func__ if isinstance(body, classmethod | staticmethod) else body
        done = hasattr(inner, "__checked__") or not inspect.isfunction(inner)
        if not done and (maker or not key.startswith("_")):
            label = owner if maker else f"{owner}.{key}"
            gate = _Gate(inner, label, bound=not isinstance(body, staticmethod) or maker)
            if gate.parameters:
                guarded = gate.function()
                setattr(thing, key, guarded if inner is body else type(body)(guarded))
    return thing


def checks_itself(method: Thing) -> Thing:
    """Leave a method's arguments to itself: inside the package, too, it is given what a user gave."""
    method.__checked__ = True  # type: ignore[attr-defined]
    return method


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
                    self._look(key, args[k], sys._getframe(1))
            for key, value in kwargs.items():
                if key in usual and type(value) not in usual[key]:
                    self._look(key, value, sys._getframe(1))
            try:
                return inner(*args, **kwargs)
            except InputError:
                raise
            except _STUMBLES as error:
                if called_by_user(sys._getframe(1)):
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

    def _look(self, key: str, value: Any, caller: FrameType) -> None:
        if value is not self.parameters[key].default and not fits(value, self.hints[key]):
            where, part, hint = innermost(key, value, self.hints[key])
            nearest = ""
            if typing.get_origin(hint) is Literal and isinstance(part, str):
                nearest = did_you_mean(part, typing.get_args(hint))
                nearest = "" if nearest.startswith("; known") else nearest  # all are named already
            expected = described(hint)
            text = f"{self.name}: {where}: expected {expected}, found {shown(part)}{nearest}"
            raise InputError(text) if called_by_user(caller) else TypeError(text)

    def _blame(self, error: Exception, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
        """Raise an error of one line where an argument holds no number, or one that is not finite."""
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
            if fault:
                raise InputError(f"{self.name}: {key}: expected {fault}, found {shown(value)}") from error


def as_user(function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
    """Call a function with what a user gives elsewhere, in a file perhaps: its gate speaks to the user.

    Parameters
    ----------
    function : callable
    *args, **kwargs

    Examples
    --------
    >>> from hovercontrol.controllers.references import circle
    >>> as_user(circle, radius="wide", rate=0.2)
    Traceback (most recent call last):
        ...
    hovercontrol.errors.InputError: circle: radius: expected a number, found 'wide'
    """
    return function(*args, **kwargs)


def called_by_user(frame: FrameType | None) -> bool:
    """Return whether a call comes from code outside the package; what libraries call is their caller's."""
    while frame is not None:
        if frame.f_code is as_user.__code__:
            return True
        file = frame.f_code.co_filename
        if file.startswith(_PACKAGE):
            return False
        if not file.startswith(_LIBRARIES):
            return True
        frame = frame.f_back
    return True


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
    if isinstance(value, list | tuple) and value:  # of anything: it is not made an array
        found = next(filter(None, map(fault_of, value[:LOOKED_AT])), "")
        return "finite numbers" if found == "a finite number" else found
    if isinstance(value, np.ndarray | list | tuple) and np.size(value) == 0:
        return "at least one value"
    if not isinstance(value, np.ndarray | np.generic | Real):
        return ""
    try:
        numbers = np.asarray(value, dtype=float)
    except OverflowError:
        return "numbers of a usual size"
    except (TypeError, ValueError):
        return ""
    if not np.all(np.isfinite(numbers)):
        return "finite numbers" if numbers.ndim else "a finite number"
    return "numbers of a usual size" if np.any(np.abs(numbers) > LARGEST) else ""
