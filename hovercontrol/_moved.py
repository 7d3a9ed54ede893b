"""Former module paths: scripts that import ``hovercontrol.block`` find ``hovercontrol.core.block``."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

_INTO = {
    "core": "block boundary checking delays derivatives equations expressions friction interconnect lookup "
    "sgn signals switching tick_order ticks units unitsyntax",
    "models": "blockmodel fans model modelfile vehicles",
    "simulation": "hybrid",
    "io": "files plain_json pythonfile tables",
    "controllers": "references",
}

#: Where each former module lies now, both without the package's name.
MOVED = {
    **{name: f"{package}.{name}" for package, names in _INTO.items() for name in names.split()},
    "model_template": "models.template",
    "noise": "core.random_numbers",
    "commands.progress": "notebook.progress",
    "estimators.ins.runs": "simulation.sampled",
    "targets.numpy": "core.functions",
    "targets.runner": "simulation.runner",
    "fmi.imported": "fmi.importer.imported",
    "fmi.export": "fmi.exporter.export",
    "autopilot.sides": "autopilot.ground_onboard",
    "autopilot.choice": "autopilot.selector",
}


class _Former:
    """Finds a module under the path that it had."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec for a former path, None for all others."""
        root, _, name = fullname.partition(".")
        former = root == "hovercontrol" and name in MOVED
        return ModuleSpec(fullname, self) if former else None  # type: ignore[arg-type]

    def create_module(self, spec: ModuleSpec) -> None:
        """Leave that to Python."""

    def exec_module(self, module: ModuleType) -> None:
        """Give the former module every name of the one that took its place."""
        import warnings

        now = f"hovercontrol.{MOVED[module.__name__.partition('.')[2]]}"
        warnings.warn(f"{module.__name__} is {now} now", DeprecationWarning, stacklevel=2)
        here = importlib.import_module(now)
        module.__dict__.update({k: v for k, v in vars(here).items() if k not in ("__name__", "__spec__")})
        module.__dict__["__getattr__"] = lambda name: getattr(here, name)


def find_former_modules() -> None:
    """Let imports find modules under their former paths; asked last, it hides nothing that exists."""
    if not any(isinstance(finder, _Former) for finder in sys.meta_path):
        sys.meta_path.append(_Former())
