"""The public API, walked: all that a script may use says what it is, in what units, and shows itself at work.

Everything without an underscore is documented and typed. What the package and its parts offer (``__all__``)
says more: each argument, its unit and shape, the result, the errors, and an example that runs as a doctest.
"""

import dataclasses
import importlib
import inspect
import pkgutil
import re

import pytest

import hovercontrol

MODULES = [
    "hovercontrol",
    *sorted(
        m.name
        for m in pkgutil.walk_packages(hovercontrol.__path__, "hovercontrol.")
        if not m.name.endswith("__main__")
    ),
]
NUMBERS, ARRAYS = re.compile(r"float|ArrayLike|Array|Floats"), re.compile(r"ArrayLike|Array|Floats")
UNIT = re.compile(r"\[[^\]]*\]|\bunit|dimensionless|probability|share|factor|weight|ratio", re.IGNORECASE)
SHAPE = re.compile(r"shape|\(n\b|\(\.\.\.|scalar|same|length|broadcast|\bas (for|in|:)", re.IGNORECASE)


def public(module):
    for name, thing in vars(module).items():
        own = getattr(thing, "__module__", None) == module.__name__
        if not name.startswith("_") and own and (inspect.isclass(thing) or inspect.isfunction(thing)):
            yield name, thing


def offered():
    """What the package and its parts offer, by full name."""
    found = {}
    for module in map(importlib.import_module, MODULES):
        for name in getattr(module, "__all__", ()):
            thing = getattr(module, name)
            if inspect.isclass(thing) or inspect.isfunction(thing):
                found[f"{thing.__module__}.{thing.__qualname__}"] = thing
    return dict(sorted(found.items()))


OFFERED = offered()
FUNCTIONS = {name: thing for name, thing in OFFERED.items() if inspect.isfunction(thing)}
CLASSES = {name: thing for name, thing in OFFERED.items() if inspect.isclass(thing)}


def methods(cls):
    """A class's own public functions, properties and class methods."""
    for name, body in vars(cls).items():
        inner = body.__func__ if isinstance(body, classmethod | staticmethod) else body
        inner = inner.fget if isinstance(inner, property) else inner
        if not name.startswith("_") and inspect.isfunction(inner):
            yield name, inner


#: Each offered function and method, and the docstring that speaks for it (a method's class speaks, too).
CALLED = {name: (thing, inspect.getdoc(thing) or "", "") for name, thing in FUNCTIONS.items()} | {
    f"{name}.{method}": (body, inspect.getdoc(body) or "", inspect.getdoc(cls) or "")
    for name, cls in CLASSES.items()
    for method, body in methods(cls)
}


def arguments(function):
    return {a: p for a, p in inspect.signature(function).parameters.items() if a not in ("self", "cls")}


def annotation(of):
    return re.sub(r"Callable\[.*\]", "", str(of))


def named(argument, text):
    return re.search(rf"\b{re.escape(argument)}\b", text)


def test_every_module_class_function_and_method_is_documented():
    silent = []
    for name in MODULES:
        module = importlib.import_module(name)
        silent += [name] * (not module.__doc__)
        for label, thing in public(module):
            silent += [f"{name}.{label}"] * (not inspect.getdoc(thing))
            for method, _ in methods(thing) if inspect.isclass(thing) else ():
                silent += [f"{name}.{label}.{method}"] * (not inspect.getdoc(getattr(thing, method)))
    assert not silent


def test_every_public_argument_is_typed():
    untyped = [
        f"{name}.{label}({argument.name})"
        for name in MODULES
        for label, thing in public(importlib.import_module(name))
        if inspect.isfunction(thing)
        for argument in inspect.signature(thing).parameters.values()
        if argument.annotation is inspect.Parameter.empty
    ]
    assert not untyped


def test_what_the_package_promises_is_there():
    for name in hovercontrol.__all__:
        assert getattr(hovercontrol, name) is not None


def test_the_walk_sees_the_package():
    assert len(MODULES) > 300 and len(OFFERED) > 200 and len(CALLED) > 300


def test_each_argument_is_told():
    silent = [f"{q}({a})" for q, (f, text, _) in CALLED.items() for a in arguments(f) if not named(a, text)]
    assert not silent


def test_each_field_of_a_record_is_told():
    silent = []
    for q, cls in CLASSES.items():
        for f in dataclasses.fields(cls) if dataclasses.is_dataclass(cls) else ():
            if not f.name.startswith("_") and not named(f.name, inspect.getdoc(cls) or ""):
                silent.append(f"{q}.{f.name}")
    assert not silent


def test_numbers_have_units_and_arrays_have_shapes():
    without_unit, without_shape = [], []
    records = {q: (c, inspect.getdoc(c), "") for q, c in CLASSES.items() if dataclasses.is_dataclass(c)}
    for q, (thing, own, of_class) in {**CALLED, **records}.items():
        text = own + of_class
        for a, p in arguments(thing).items():
            if NUMBERS.search(annotation(p.annotation)) and not UNIT.search(text):
                without_unit.append(f"{q}({a})")
            if ARRAYS.search(annotation(p.annotation)) and not SHAPE.search(text):
                without_shape.append(f"{q}({a})")
        if ARRAYS.search(annotation(inspect.signature(thing).return_annotation)) and not SHAPE.search(text):
            without_shape.append(f"{q}: its result")
    assert not without_unit
    assert not without_shape


def test_each_result_is_told():
    silent = [
        q
        for q, thing in FUNCTIONS.items()
        if inspect.signature(thing).return_annotation not in ("None", None)
        and not re.search(r"\b(Return|Yield)", inspect.getdoc(thing))
    ]
    assert not silent


def test_each_error_that_is_raised_is_told():
    silent = [
        q
        for q, (f, text, _) in CALLED.items()
        if re.search(r"^\s+raise InputError\(", inspect.getsource(f), re.MULTILINE) and "Raises" not in text
    ]
    assert not silent


def test_each_thing_shows_itself_at_work():
    def shows(thing):
        return ">>>" in (inspect.getdoc(thing) or "")

    silent = [
        q
        for q, t in OFFERED.items()
        if not shows(t) and (q in FUNCTIONS or not any(shows(b) for _, b in methods(t)))
    ]
    assert not silent


@pytest.mark.parametrize(
    "call",
    [
        lambda: hovercontrol.ellipse(1.0, 2.0, speed=1.0),
        lambda: hovercontrol.tracking_controller(hovercontrol.vehicle("hoverdemon"), gain=1.0),
        lambda: hovercontrol.interconnect([], "x", wires=[]),
    ],
)
def test_unknown_keywords_are_refused(call):
    with pytest.raises(TypeError, match="unexpected keyword"):
        call()
