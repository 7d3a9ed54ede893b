"""Effects: what each adds to which equation, and how it shows in a run."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path

from matplotlib.figure import Figure

from generate import effect_runs
from generate.equations import changed_lines
from generate.pages import bounds, first_sentence, html, picture, table, toctree, write
from hovercontrol.base.figure_style import figure_style
from hovercontrol.craft.effects import Effect, Shape, effect_class, effect_names
from hovercontrol.craft.models.model import Model

KINDS = {
    "force": "Forces and torques",
    "input": "Commands and actuators",
    "measurement": "Measurements",
}


def pages(into: Path) -> tuple[str, str]:
    """Write a page for each effect and one with all of them."""
    runs = effect_runs.every_run()
    groups: dict[str, list[str]] = defaultdict(list)
    for name in effect_names():
        cls = effect_class(name)
        groups[cls.kind()].append(name)
        _page(cls, runs, into / "effects")
    sections = []
    for kind, title in KINDS.items():
        rows = [
            (
                f"[`{n}`](effects/{n}.md)",
                effect_class(n).place(),
                first_sentence(effect_class(n).__doc__),
                effect_class(n).source,
            )
            for n in groups[kind]
        ]
        sections.append(f"## {title}\n\n{table(('effect', 'place', 'what it is', 'source'), rows)}")
    write(
        into / "effects.md",
        "# Effects",
        "A model is planar rigid-body motion plus a list of effects, one line each in a model file. "
        "[`diagnose`](commands/diagnose.md) searches this list for effects that a model lacks. "
        "An effect of your own is [one class](../tutorials/effect.md).",
        *sections,
        toctree(f"effects/{name}" for name in effect_names()),
    )
    return "effects", f"{len(effect_names())} effects"


def _page(cls: type[Effect], runs: effect_runs.Runs, folder: Path) -> None:
    seen = runs.seen[cls.name]
    shape = f"{{{', '.join(f'{k} = {v:.4g}' for k, v in seen.effect.values.items() if _told(cls, k, v))}}}"
    line = f"{seen.effect.values['value']:.4g}" if set(cls.numbers) == {"value"} else shape
    text = folder / cls.name
    write(
        folder / f"{cls.name}.md",
        f"# {cls.name}",
        first_sentence(cls.__doc__),
        f"**Acts on** {_acts(cls)}. **Place**: {cls.place()}. **Source**: {cls.source or 'none'}.",
        "## Equation",
        "The terms of the effect are marked; c with a subscript is a coefficient.",
        html(changed_lines(_without(seen.base, cls.name), seen.model)),
        _timing(seen),
        "## Numbers",
        table(("number", "unit", "bounds", "default", "enters"), [_row(cls, k) for k in cls.numbers]),
        "## In a model file",
        f"```toml\n[effects]\n{cls.name} = {line}\n```",
        "## Motion without and with the effect",
        f"The craft [`{seen.base.name}`](../vehicles/{seen.base.name}.md) drives {seen.manoeuvre.text}.",
        picture(_drawn(seen), text, f"The motion without and with {cls.name}"),
        "## Which manoeuvre shows it",
        "Change of the measurements, after the model's own coefficients are fitted again, as a share of the "
        "motion (root mean square):",
        table(
            ("manoeuvre", "change"),
            [(n, f"{100 * v:.2g} %" if v > 1e-6 else "0") for n, v in seen.shown_by()],
        ),
        "## Similar effects",
        _twins(cls.name, runs),
    )


def _drawn(seen: effect_runs.Seen) -> Figure:
    with figure_style():
        return seen.figure()


def _without(model: Model, name: str) -> Model:
    """Return a model that has no such effect."""
    return replace(model, effects=tuple(e for e in model.effects if e.name != name))


def _told(cls: type[Effect], key: str, value: float) -> bool:
    return value != cls.numbers[key].default


def _acts(cls: type[Effect]) -> str:
    where = {
        "force": "the accelerations",
        "input": "the commands",
        "measurement": "the measurements",
    }
    craft = {"rudder": ", on craft with a propeller and a rudder", "fan": ", on craft with fans"}
    asked = "; `diagnose` names it only if `--effects` lists it" if cls.mistaken_for else ""
    return where[cls.kind()] + craft.get(cls.craft, "") + asked


def _row(cls: type[Effect], key: str) -> tuple[str, ...]:
    number = cls.numbers[key]
    default = "" if number.default is None else f"{number.default:g}"
    enters = "as a shape" if isinstance(number, Shape) else "linearly"
    return (f"`{cls.parameter(key)}`", number.unit, bounds(number.lower, number.upper), default, enters)


def _timing(seen: effect_runs.Seen) -> str:
    late = [n.rpartition(".")[2] for n in seen.model.timing() if n]
    return f"No equation holds `{late[0]}`: it shifts commands against measurements." if late else ""


def _twins(name: str, runs: effect_runs.Runs) -> str:
    near = runs.twins(name)
    if not near:
        return (
            "None: no other effect changes these manoeuvres in the same way (cosine of the two changes, after the "
            f"model's own coefficients are fitted again, above {effect_runs.NEAR})."
        )
    rows = [(f"[`{n}`]({n}.md)", f"{c:.3f}") for n, c in near]
    return (
        "Effects that change the measurements in the same way on all manoeuvres, after the model's own coefficients "
        "are fitted again. At a cosine of 1 no log of these manoeuvres distinguishes them.\n\n"
        + table(("effect", "cosine"), rows)
    )
