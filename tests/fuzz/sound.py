"""Sound calls of everything that the package offers, taken from the examples of its docstrings.

An example runs until it calls what it shows; the arguments of that call are kept and the example ends there,
so that one of many seconds costs what leads up to it.
"""

from __future__ import annotations

import contextlib
import dataclasses
import doctest
import inspect
import os
import sys
import tempfile
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from tests.fuzz.judge import Broken, limited
from tests.test_public_api import CALLED, CLASSES, OFFERED, arguments, methods

#: What the package offers and can be called with arguments: functions, constructors, methods. What an effect
#: says of its symbols, ``terms(c, s)``, is called by the package alone.
CALLABLES = {
    name: thing
    for name, thing in {**{q: f for q, (f, _, _) in CALLED.items()}, **CLASSES}.items()
    if not inspect.isclass(thing) or not getattr(thing, "_is_protocol", False)
    if name != "hovercontrol.blocks.sgn.sgn" and arguments(thing) and list(arguments(thing)) != ["c", "s"]
}


@dataclass(frozen=True)
class Call:
    """A call with arguments that are right."""

    name: str
    function: Callable[..., Any]
    given: Mapping[str, Any]

    def __call__(self, **changed: Any) -> object:
        given = {**self.given, **changed}
        parameters = inspect.signature(self.function).parameters
        star = next((name for name, p in parameters.items() if p.kind is p.VAR_POSITIONAL), "")
        if not star:
            return self.function(**given)
        before = [given.pop(name) for name in list(parameters)[: list(parameters).index(star)]]
        return self.function(*before, *given.pop(star), **given)


class _Seen(KeyboardInterrupt):
    """The call that an example was run for has come; a doctest keeps no other exception from ending it."""


def sound_calls(patience: float = 60.0, only: str = "") -> dict[str, Call]:
    """Return a call of each callable whose example came to it within so many seconds."""
    frames: dict[str, dict[str, Any]] = {}
    wanted = {_code(thing): name for name, thing in CALLABLES.items() if _code(thing)}
    here = os.getcwd()
    with tempfile.TemporaryDirectory(prefix="hc-sound-") as folder, contextlib.chdir(folder):
        for name, thing in _shown():
            if name in frames or only not in name:
                continue
            with contextlib.suppress(Broken), limited(patience):
                _run(name, thing, wanted, frames)
    assert os.getcwd() == here
    calls = {name: _call(name, frames[name]) for name in CALLABLES if name in frames and only in name}
    return calls | dict(_of_instances(calls, only))


def _shown() -> Iterator[tuple[str, Any]]:
    """Yield each thing that has an example; those of methods stand with their classes."""
    yield from OFFERED.items()
    for name, cls in CLASSES.items():
        for method, body in methods(cls):
            yield f"{name}.{method}", body


def _run(name: str, thing: Any, wanted: Mapping[Any, str], frames: dict[str, dict[str, Any]]) -> None:
    module = sys.modules[thing.__module__]
    text = inspect.getdoc(thing) or ""
    test = doctest.DocTestParser().get_doctest(text, dict(vars(module)), name, None, 0)

    def watch(frame: types.FrameType, event: str, _: object) -> None:
        found = wanted.get(frame.f_code) if event == "call" else None
        if found and found not in frames:
            frames[found] = dict(frame.f_locals)
            if found == name:
                raise _Seen

    sys.setprofile(watch)
    try:
        doctest.DocTestRunner(verbose=False).run(test, out=lambda _: None)
    except _Seen:
        pass
    finally:
        sys.setprofile(None)


def _code(thing: Any) -> Any:
    body = vars(thing).get("__init__") if inspect.isclass(thing) else thing
    return getattr(inspect.unwrap(body), "__code__", None) if body else None


def _call(name: str, frame: Mapping[str, Any]) -> Call:
    thing = CALLABLES[name]
    function = thing
    if name in CLASSES and not dataclasses.is_dataclass(thing):
        function = type(frame["self"])  # one that can be made
    if name in CALLED and name.rpartition(".")[0] in CLASSES:
        owner = frame.get("self", frame.get("cls"))
        function = types.MethodType(thing, owner)  # not what a class of the example makes of it
    given: dict[str, Any] = {}
    for key, parameter in inspect.signature(function).parameters.items():
        if parameter.kind is parameter.VAR_KEYWORD:
            given |= frame[key]
        else:
            given[key] = frame[key]
    return Call(name, function, given)


def _of_instances(calls: Mapping[str, Call], only: str) -> Iterator[tuple[str, Call]]:
    """Yield calls of methods that no example calls, on instances made as examples make them."""
    for name in CALLABLES:
        owner = name.rpartition(".")[0]
        if name in calls or owner not in calls or name in CLASSES:
            continue
        method = getattr(calls[owner](), name.rpartition(".")[2])
        if inspect.ismethod(method):
            method = types.MethodType(CALLABLES[name], method.__self__)
        found = inspect.signature(method).parameters.values()
        needed = [p for p in found if p.default is p.empty and p.kind is not p.VAR_KEYWORD]
        yield name, Call(name, method, {p.name: _guess(p, calls) for p in needed})


def _guess(parameter: inspect.Parameter, calls: Mapping[str, Call]) -> Any:
    """Return a value of an argument, by what its annotation begins with."""
    annotation = str(parameter.annotation)
    for name, call in calls.items():
        if name.rpartition(".")[2] == annotation and name in CLASSES:
            return call()
    guesses = {"ArrayLike": [0.0, 1.0], "Mapping": {}, "Sequence": [], "Path": "out", "float": 1.0, "int": 2}
    known = next((value for word, value in guesses.items() if word in annotation), "out")
    return [known] if parameter.kind is parameter.VAR_POSITIONAL else known
