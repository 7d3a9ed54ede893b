"""Argument checks of public functions: a script's arguments are checked before they are used.

The annotation of an argument declares its type. :func:`checked` compares each argument with its annotation.
On a mismatch, a one-line message names the function, the argument, the expected type and the value found. A
value of a usual type passes after one set lookup.

Only calls from outside the package raise :class:`.InputError`. A wrong argument in a call from inside is a
bug of the package and raises ``TypeError``; other errors of such calls are passed on unchanged.
"""

from __future__ import annotations

import ast
import functools
import inspect
import os
import sys
import sysconfig
import typing
from collections.abc import Callable, Iterator, Mapping, Sized
from numbers import Real
from pathlib import Path
from types import FrameType
from typing import Any, Literal, TypeVar

import numpy as np

from hovercontrol.base.annotations import LOOKED_AT, alternatives, described, fits, innermost, usual_types
from hovercontrol.base.errors import CallError, InputError, did_you_mean, shown

Thing = TypeVar("Thing", bound=Callable[..., Any])

#: Errors that Python and NumPy raise if a value cannot be used in a calculation.
_STUMBLES = ValueError, ArithmeticError, IndexError, MemoryError

_NAMED = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY

_PACKAGE = str(Path(__file__).parents[1]) + os.sep
_LIBRARIES = tuple({sysconfig.get_path(name) + os.sep for name in ("stdlib", "purelib", "platlib")})


def checked(thing: Thing, name: str = "") -> Thing:
    """Make a public function, or a class's constructor and methods, check the types of its arguments.

    Parameters
    ----------
    name : str, optional
        Name of a class in error messages (default: its own name).

    Returns
    -------
    function or class
        The checked function, or the same class with checked methods. An argument that does not match its
        annotation raises :class:`.InputError`; the one-line message names the function, the argument, the
        expected type and the value found. The same error replaces one of Python or NumPy if an argument is
        not usable in calculations (NaN, infinite, above 1e150, or an empty array). Both apply to calls from
        outside the package. A wrong argument from inside raises ``TypeError``; other errors are not replaced.

    Examples
    --------
    >>> @checked
    ... def turn(rate: float, times: int = 1) -> float:
    ...     return rate / times
    >>> turn("fast")
    Traceback (most recent call last):
        ...
    hovercontrol.base.errors.InputError: turn: rate: expected a number, found 'fast'
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
    """Mark a method that checks its own arguments: calls from inside the package also pass users' values."""
    method.__checked__ = True  # type: ignore[attr-defined]
    return method


class _Gate:
    """Checks the arguments of one function against its annotations, which are read at the first call."""

    def __init__(self, function: Callable[..., Any], name: str, bound: bool = False) -> None:
        self.inner, self.name = function, name
        found = list(inspect.signature(function).parameters.values())[bound:]
        self.parameters = {one.name: one for one in found}
        self.skipped = int(bound)
        self.hints: dict[str, Any] = {}
        self.kinds: dict[str, tuple[Any, ...]] = {}

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
                self.kinds = {key: alternatives(hint) for key, hint in self.hints.items()}
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
            except TypeError as error:
                if called_by_user(sys._getframe(1)):
                    self._check_call(error, args, kwargs)
                raise

        guard.__checked__ = True  # type: ignore[attr-defined]
        return guard

    def _of(self, *kinds: Any) -> Iterator[inspect.Parameter]:
        return (one for one in self.parameters.values() if one.kind in kinds)

    def _positions(self) -> list[str]:
        kinds = inspect.Parameter.POSITIONAL_ONLY, inspect.Parameter.POSITIONAL_OR_KEYWORD
        return [one.name for one in self._of(*kinds)]

    def _read(self) -> dict[str, Any]:
        """Return the annotations of the arguments."""
        found, names = {}, inspect.unwrap(self.inner).__globals__
        for key, parameter in self.parameters.items():
            hint = parameter.annotation
            if parameter.kind is inspect.Parameter.VAR_KEYWORD or hint is inspect.Parameter.empty:
                continue  # without an annotation, or keyword arguments that the function checks itself
            try:
                found[key] = eval(hint, names) if isinstance(hint, str) else hint
            except NameError:
                found[key] = eval(hint, names, names_for_checkers(self.inner.__module__))
        return found

    def _look(self, key: str, value: Any, caller: FrameType) -> None:
        if value is self.parameters[key].default or any(fits(value, kind) for kind in self.kinds[key]):
            return
        where, part, hint = innermost(key, value, self.hints[key])
        nearest = ""
        if typing.get_origin(hint) is Literal and isinstance(part, str):
            nearest = did_you_mean(part, typing.get_args(hint))
            nearest = "" if nearest.startswith("; known") else nearest  # the message lists them all
        elsewhere = [
            name for name, kinds in self.kinds.items()
            if name != key and not isinstance(value, str | Real | None) and any(fits(value, k) for k in kinds)
        ]  # fmt: skip
        nearest = f"; did you mean {elsewhere[0]}=...?" if len(elsewhere) == 1 else nearest
        expected = described(hint)
        text = f"{self.name}: {where}: expected {expected}, found {shown(part)}{nearest}"
        raise InputError(text) if called_by_user(caller) else TypeError(text)

    def _usual(self, key: str, value: Any) -> bool:
        """Return whether a value is the default, or as empty as the default."""
        default = self.parameters[key].default
        return value is default or (default == () and isinstance(value, Sized) and len(value) == 0)

    def _check_call(self, error: TypeError, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
        """Raise a one-line error if the call has an argument too many or too few."""
        signature = inspect.signature(self.inner)
        try:
            signature.bind(*args, **kwargs)
        except TypeError as wrong:
            known = [one.name for one in self._of(*_NAMED)]
            unknown = next((key for key in kwargs if key not in known), None)
            hint = did_you_mean(unknown, known) if unknown else f"; arguments: {', '.join(known)}"
            said = f"got an unexpected keyword argument {unknown!r}" if unknown else str(wrong)
            if said.startswith("missing"):
                given = signature.bind_partial(*args, **kwargs).arguments
                needed = [k for k in known if signature.parameters[k].default is inspect.Parameter.empty]
                missing = [repr(k) for k in needed if k not in given]
                said = f"missing required argument{'s' * (len(missing) > 1)}: {', '.join(missing)}"
            raise CallError(f"{self.name}: {said}{hint}") from error

    def _blame(self, error: Exception, args: tuple[Any, ...], kwargs: Mapping[str, Any]) -> None:
        """Raise a one-line error if an argument is empty, or a number in it is not finite or too large."""
        given = dict(zip(self._positions(), args[self.skipped :], strict=False)) | dict(kwargs)
        for one in self._of(inspect.Parameter.VAR_POSITIONAL):
            given[one.name] = args[self.skipped + len(self._positions()) :]
        given = {k: v for k, v in given.items() if k in self.hints and not self._usual(k, v)}
        for key, value in given.items():
            fault = fault_of(value)
            if fault:
                raise InputError(f"{self.name}: {key}: expected {fault}, found {shown(value)}") from error


def as_user(function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Any:
    """Call a function with a user's values, such as from a file; errors are raised as for a user's call.

    Examples
    --------
    >>> from hovercontrol.control.controllers.references import circle
    >>> as_user(circle, radius="wide", rate=0.2)
    Traceback (most recent call last):
        ...
    hovercontrol.base.errors.InputError: circle: radius: expected a number, found 'wide'
    """
    return function(*args, **kwargs)


def called_by_user(frame: FrameType | None) -> bool:
    """Return whether a call comes from outside the package; a library's call counts as its caller's."""
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
    """Return the names that a module imports only ``if TYPE_CHECKING``; its annotations use them.

    Examples
    --------
    >>> names_for_checkers("hovercontrol.control.analysis.regions")["pyarrow"].__name__
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


#: Largest magnitude of a usable number; larger values may overflow when squared.
LARGEST = 1e150


def fault_of(value: Any) -> str:
    """Return what a calculation expects instead of this value, for an error message; "" if it is usable.

    Examples
    --------
    >>> fault_of([1.0, float("nan")]), fault_of([]), fault_of(2.0)
    ('finite numbers', 'at least one value', '')
    """
    if isinstance(value, Mapping):
        return next(filter(None, map(fault_of, list(value.values())[:LOOKED_AT])), "")
    if isinstance(value, list | tuple) and value:  # may hold any objects, so it is not converted to an array
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
