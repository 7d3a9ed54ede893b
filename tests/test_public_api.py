"""The public API, walked: everything a script may use says what it is."""

import importlib
import inspect
import pkgutil

import pytest

import hovercontrol

#: Others own and test these.
ELSEWHERE = (
    "hovercontrol.logs",
    "hovercontrol.identify",
    "hovercontrol.scenarios",
    "hovercontrol.analysis",
    "hovercontrol.cli",
    "hovercontrol.discrepancy",
    "hovercontrol.fmi",
    "hovercontrol.hardware",
)
MODULES = sorted(
    m.name
    for m in pkgutil.walk_packages(hovercontrol.__path__, "hovercontrol.")
    if not m.name.startswith(ELSEWHERE)
)


def public(module):
    for name, thing in vars(module).items():
        own = getattr(thing, "__module__", None) == module.__name__
        if not name.startswith("_") and own and (inspect.isclass(thing) or inspect.isfunction(thing)):
            yield name, thing


@pytest.mark.parametrize("name", MODULES)
def test_every_module_class_function_and_method_is_documented(name):
    module = importlib.import_module(name)
    assert module.__doc__, name
    for label, thing in public(module):
        assert inspect.getdoc(thing), f"{name}.{label}"
        if inspect.isclass(thing):
            for method, body in vars(thing).items():
                if not method.startswith("_") and (inspect.isfunction(body) or isinstance(body, property)):
                    assert inspect.getdoc(getattr(thing, method)), f"{name}.{label}.{method}"


@pytest.mark.parametrize("name", MODULES)
def test_every_public_argument_is_typed(name):
    for label, thing in public(importlib.import_module(name)):
        if inspect.isfunction(thing):
            for argument in inspect.signature(thing).parameters.values():
                assert argument.annotation is not inspect.Parameter.empty, f"{name}.{label}({argument.name})"


def test_what_the_package_promises_is_there():
    for name in hovercontrol.__all__:
        assert getattr(hovercontrol, name) is not None


def test_a_function_with_parameters_documents_each_of_them():
    for name in (
        "interconnect",
        "tracking_controller",
        "kalman_bucy",
        "regression",
        "waypoints",
        "ellipse",
    ):
        thing = getattr(hovercontrol, name)
        text = inspect.getdoc(thing)
        for argument in inspect.signature(thing).parameters:
            if argument != "name":
                assert argument in text, f"{name}({argument})"


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
