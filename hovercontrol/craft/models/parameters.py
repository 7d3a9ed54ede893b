"""The parameter file: fitted values of a model that is written in Python, as TOML.

A craft is saved as a model file. The equations of an own Block stay in their Python file; the parameter file
has the values of its coefficients, the added effects, and what stands in place of its unknown functions
(:mod:`.functions`).

.. code-block:: toml

    [model]
    name = "motor"

    [coefficients]
    gain = 13.9             # rad/s^2/V
    damping = 3.8           # 1/s

    [effects]
    speed_coulomb = 0.4
    input_delay = {seconds = 0.04}
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

from hovercontrol.base.boundary import as_user, checked
from hovercontrol.base.errors import InputError, shown
from hovercontrol.base.files import write_atomically
from hovercontrol.base.tables import check_keys, number, read_toml, table, text
from hovercontrol.craft.effects import Effect
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.functions import known_function
from hovercontrol.craft.models.interface import AnyModel, as_model
from hovercontrol.craft.models.model import Model
from hovercontrol.craft.models.modelfile import effect_text, save_model


@checked
def save_parameters(model: AnyModel, path: str | Path) -> Path:
    """Write the values of a model's coefficients, and its effects, to a parameter file, atomically.

    Parameters
    ----------
    model : Model, BlockModel or Block
    path : path
        Of the TOML file.

    Returns
    -------
    Path

    Examples
    --------
    >>> import tempfile, hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=0.7)
    >>> decay = hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print(save_parameters(decay, Path(folder) / "parameters.toml").read_text(), end="")
    [model]
    name = "decay"
    <BLANKLINE>
    [coefficients]
    k = 0.7  # 1/s
    """
    subject = as_model(model)
    added = {e.parameter(key) for e in subject.effects for key in e.numbers}
    block = subject.plant(late=True)
    functions = subject.fitted_functions() if isinstance(subject, BlockModel) else ()
    added |= {name for f in functions for name in (*f.parameters, *f.scales)}
    lines = ["[model]", f"name = {json.dumps(subject.name, ensure_ascii=False)}"]
    own = {name: value for name, value in subject.coefficients().items() if name not in added}
    if own:
        lines += ["", "[coefficients]"]
        lines += [f"{_key(n)} = {v!r}  # {block.parameter(n).unit or '1'}" for n, v in own.items()]
    for f in functions:
        lines += ["", f"[functions.{_key(f.of.name)}]", *f.lines()]
    if subject.effects:
        lines += ["", "[effects]", *(f"{_key(e.name)} = {effect_text(e)}" for e in subject.effects)]
    content = "\n".join(lines) + "\n"
    return write_atomically(path, lambda temporary: temporary.write_text(content, encoding="utf-8"))


@checked
def load_parameters(model: AnyModel, path: str | Path) -> Model | BlockModel:
    """Return a model with the values and effects of a parameter file.

    Parameters
    ----------
    model : Model, BlockModel or Block
        Values that the file does not name are kept.
    path : path
        TOML file written by :func:`save_parameters`, ``hovercontrol identify`` or ``diagnose``.

    Returns
    -------
    Model or BlockModel

    Raises
    ------
    InputError
        If the file belongs to another model, names an unknown coefficient or effect, or a value is not a
        number or out of its bounds. The message names file, key and the nearest match.

    Examples
    --------
    >>> import tempfile, hovercontrol as hc
    >>> v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=0.7)
    >>> decay = hc.Block("decay", [v], [], [v], [k], {"v": -k.symbol * v.symbol})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = save_parameters(decay.with_values({"k": 0.4}), Path(folder) / "parameters.toml")
    ...     load_parameters(decay, file).coefficients()
    {'k': 0.4}
    """
    content = read_toml(path)
    try:
        return _with(as_model(model), content)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from None


#: Files of which a fit writes one.
FITTED = ("model.toml", "parameters.toml")


def save_fitted(model: Model | BlockModel, folder: Path) -> Path:
    """Write a fitted model to a folder: a craft as ``model.toml``, any other as ``parameters.toml``."""
    craft, other = (folder / name for name in FITTED)
    return save_model(model, craft) if isinstance(model, Model) else save_parameters(model, other)


def _with(model: Model | BlockModel, content: dict[str, Any]) -> Model | BlockModel:
    check_keys("section", content, ("model", "coefficients", "functions", "effects"))
    head = table("[model]", content.get("model", {}))
    check_keys("key in [model]", head, ("name",))
    name = text("model.name", head.get("name", model.name))
    if name != model.name:
        raise InputError(f"model.name: expected {shown(model.name)}, found {shown(name)}")
    functions = table("[functions]", content.get("functions", {}))
    for key, value in functions.items():
        if not isinstance(model, BlockModel):
            raise InputError(f"functions.{key}: {model.name!r} has no unknown functions")
        model = model.with_functions([known_function(model.block, key, table(f"functions.{key}", value))])
    effects = table("[effects]", content.get("effects", {}))
    values = table("[coefficients]", content.get("coefficients", {}))
    numbers = {key: number(f"coefficients.{key}", value) for key, value in values.items()}
    check_keys("coefficient", numbers, model.coefficients())
    new = model.with_effects([_effect(model, key, value) for key, value in effects.items()])
    return new.with_coefficients(numbers)


def _effect(model: Model | BlockModel, name: str, value: Any) -> Effect:
    cls = model.effect_class(name)
    given = value if isinstance(value, dict) else {"value": value}
    check_keys(f"key in effects.{name}", given, cls.numbers)
    return as_user(cls, **{key: number(f"effects.{name}.{key}", v) for key, v in given.items()})


def _key(name: str) -> str:
    """Return a name as a TOML key: quoted if it has dots."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)
