"""The tools that come with the benchmark, by name, and tools from a user's file."""

from __future__ import annotations

import inspect
from typing import Any

from hovercontrol.base.errors import InputError, did_you_mean
from hovercontrol.base.pythonfile import from_python, names_python
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.identification.benchmark.answer import Answer, Term, Tool
from hovercontrol.identification.benchmark.rivals import arx, sindy
from hovercontrol.identification.benchmark.scoring import effect_terms
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.logs import Log


def own(model: AnyModel, train: tuple[Log, ...], holdout: Log) -> Answer:
    """Return the answer of :func:`hovercontrol.diagnose`.

    Its verdict ``none`` is ``"none"``; all others are ``"missing"``. With ``effect`` and ``partial``, what it
    names is sure; with ``ambiguous``, names and rivals are readings that are not.
    """
    found = diagnose(model, list(train), holdout)
    if found.verdict == "none":
        return Answer("none", (), found.amended)
    given, terms = as_model(model), []
    sure = found.verdict != "ambiguous"
    seen = set()
    for e in found.effects:
        if e.effect in seen:  # its first number is its coefficient
            continue
        seen.add(e.effect)
        terms += _terms(given, found.amended, e, sure)
    terms += [Term("", r.name, sure=False) for r in found.rivals if _known(given, r.name)]
    return Answer("missing", tuple(terms), found.amended)


def _known(model: Any, name: str) -> bool:
    try:
        model.effect_class(name)
    except InputError:
        return False
    return True


def _terms(model: Any, amended: Any, found: Any, sure: bool) -> list[Term]:
    """Return a named effect as a term: its name, or, if the catalogue has none, its expressions."""
    if _known(model, found.effect):
        return [Term("", found.effect, found.value, found.std, sure)]
    cls = type(amended.effect(found.effect))
    forms = effect_terms(model, cls)
    return [Term(e, str(form), found.value, found.std, sure) for e, form in forms.items()]


TOOLS: dict[str, Tool] = {"hovercontrol": own, "sindy": sindy.answer, "arx": arx.answer}


def tool_of(name: str) -> Tool:
    """Return a tool by its name, or the function that ``FILE.py:FUNCTION`` names.

    Raises
    ------
    InputError
        If there is no such tool.
    """
    if name in TOOLS:
        return TOOLS[name]
    if names_python(name):
        found: Tool = from_python(name, type(own))
        if len(inspect.signature(found).parameters) != 3:
            raise InputError(f"--tool {name}: expected a function (model, train_logs, holdout_log)")
        return found
    raise InputError(
        f"--tool: expected {', '.join(TOOLS)} or FILE.py:FUNCTION, found {name!r}{did_you_mean(name, TOOLS)}"
    )
