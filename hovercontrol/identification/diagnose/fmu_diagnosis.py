"""The result of a diagnosis of an FMU: effects around it, what remains, and files for other tools."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hovercontrol.base.boundary import checked
from hovercontrol.base.errors import InputError
from hovercontrol.base.folders import write_folder
from hovercontrol.base.plain_json import json_text, plain
from hovercontrol.fmi.replay.output_error import FmuFit
from hovercontrol.fmi.replay.plant import FmuPlant
from hovercontrol.fmi.replay.start_values import (
    around_json,
    save_around,
    save_copy,
    save_corrected,
    save_csv,
    save_ssv,
)
from hovercontrol.identification.diagnose.evidence.blocks import Blocks
from hovercontrol.identification.diagnose.search.leads import Lead
from hovercontrol.identification.diagnose.search.trace import Decision, decisions_about
from hovercontrol.identification.diagnose.verdict import Verdict

#: Name of the FMU with effects around it.
CORRECTED = "corrected.fmu"


@dataclass(frozen=True)
class FmuNamed:
    """An effect that the FMU lacks.

    Attributes
    ----------
    place : {"before", "after", "added"}
    effect : str
    numbers, std : mapping
        Its numbers and their standard errors, in the final fit.
    gain : float
        Reduction of twice the negative log likelihood, with the other named effects in the model.
    blocks : Blocks
        Its size, or gain, on disjoint blocks of the logs.
    rivals : tuple of str
        Effects that the logs do not tell from it, with their place.
    same : tuple of str
        Effects that are equivalent to it in every log: other readings of the finding.
    """

    place: str
    effect: str
    numbers: Mapping[str, float]
    std: Mapping[str, float]
    gain: float
    blocks: Blocks
    rivals: tuple[str, ...] = ()
    same: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Place and name: ``before.u_lag``."""
        return f"{self.place}.{self.effect}"

    def result(self) -> dict[str, Any]:
        """Return the entry of ``result.json``."""
        blocks = self.blocks
        found = {**vars(self), "blocks": {"n": blocks.n, "same_sign": blocks.same_sign, "t": blocks.t}}
        return found | {"rivals": list(self.rivals), "same": list(self.same)}

    def __str__(self) -> str:
        where = {"before": "before the FMU", "after": "after the FMU", "added": "in the FMU's equations"}
        said = ", ".join(f"{k} = {v:.4g} ± {self.std[k]:.2g}" for k, v in self.numbers.items())
        more = f"; the logs do not tell it from {', '.join(self.rivals)}" if self.rivals else ""
        more += f"; equivalent to {', '.join(self.same)}" if self.same else ""
        return f"{self.effect} {where[self.place]}: {said}{more}"


@checked
@dataclass(frozen=True, eq=False)
class FmuDiagnosis:
    """The result of :func:`~hovercontrol.identification.diagnose.diagnose.diagnose` of an FMU.

    Attributes
    ----------
    verdict : {"none", "effect", "partial", "ambiguous", "unexplained"}
        As of :class:`~hovercontrol.identification.diagnose.diagnosis.Diagnosis`; a remainder is a residual
        that depends on its past.
    effects : tuple of FmuNamed
    leads : tuple of Lead
        Effects that came near and are not named, with the reason.
    model : FmuPlant
        As given.
    amended : FmuPlant
        With the effects around the FMU (``amended.around``) and the estimates.
    residual_before, residual_after : mapping
        Root mean square of measured minus computed of each channel.
    remains : tuple of str
        Channels whose residual depends on its past.
    held_before, held_after : mapping
        Of each held-out log and channel: residual over spread.
    base, final : FmuFit
    trace : tuple of Decision
        Every decision of the search, in order.
    """

    verdict: Verdict
    effects: tuple[FmuNamed, ...]
    leads: tuple[Lead, ...]
    model: FmuPlant
    amended: FmuPlant
    residual_before: Mapping[str, float]
    residual_after: Mapping[str, float]
    remains: tuple[str, ...]
    held_before: Mapping[str, Mapping[str, float]]
    held_after: Mapping[str, Mapping[str, float]]
    base: FmuFit
    final: FmuFit
    trace: tuple[Decision, ...]

    def sentences(self) -> list[str]:
        """Return the result as sentences."""
        said = [f"{self.model.name} lacks {e}" for e in self.effects]
        if not self.effects:
            said = [
                f"{self.model.name} lacks nothing: its residuals are measurement noise"
                if self.verdict == "none"
                else f"{self.model.name}: no effect around the FMU explains the logs"
            ]
        said += [f"not named: {lead.name}: {lead.reason}" for lead in self.leads[:1] if not self.effects]
        sizes = [
            f"{c} {before:.3g} -> {self.residual_after[c]:.3g}" for c, before in self.residual_before.items()
        ]
        said.append(f"residuals (root mean square): {', '.join(sizes)}")
        if self.remains:
            said.append(f"the residuals of {', '.join(self.remains)} still depend on their past")
        for log, shares in self.held_after.items():
            pairs = [f"{c} {self.held_before[log][c]:.3g} -> {v:.3g}" for c, v in shares.items()]
            said.append(f"{log} (held out): residual over spread: {', '.join(pairs)}")
        return said

    def why(self, effect: str) -> list[Decision]:
        """Return the decisions of the search about an effect: why it is named, or why not.

        Parameters
        ----------
        effect : str
            With its place: ``before.u_lag``; for one that was not considered the list is empty.
        """
        return decisions_about(self.trace, effect)

    def __repr__(self) -> str:
        return "\n".join([f"FmuDiagnosis: {self.verdict}", *(f"  {line}" for line in self.sentences())])

    def result(self) -> dict[str, Any]:
        """Return the result as what JSON holds."""
        found: dict[str, Any] = plain(
            {
                "model": self.model.name,
                "verdict": self.verdict,
                "effects": [e.result() for e in self.effects],
                "leads": [{"name": one.name, "gain": one.gain, "reason": one.reason} for one in self.leads],
                "residual_before": dict(self.residual_before),
                "residual_after": dict(self.residual_after),
                "remains": list(self.remains),
                "held_before": dict(self.held_before),
                "held_after": dict(self.held_after),
                "around": around_json(self.amended.around),
                "trace": [row.result() for row in self.trace],
            }
        )
        return found

    def save(self, folder: str | Path) -> list[Path]:
        """Write result.json, around.json, start_values.csv, start_values.ssv and FMUs with the estimates.

        A copy of the FMU has the estimates as start values. If effects were found, ``corrected.fmu`` has the
        FMU inside and the effects around it (:func:`hovercontrol.fmi.corrected_fmu`). Without a C compiler
        it is not written; a warning says so.
        """

        def write(temporary: Path) -> None:
            text = json_text(self.result())
            json.loads(text)
            (temporary / "result.json").write_text(text, encoding="utf-8")
            save_around(self.amended.around, temporary / "around.json")
            save_csv(self.amended, temporary / "start_values.csv")
            save_ssv(self.amended, temporary / "start_values.ssv")
            save_copy(self.amended, temporary / self.model.path.name)
            if self.amended.around.effects:
                try:
                    save_corrected(self.amended, temporary / CORRECTED)
                except InputError as fault:  # what was found must not be lost for want of a compiler
                    warnings.warn(f"{CORRECTED} was not written: {fault}", stacklevel=2)

        return write_folder(folder, write, stale=(CORRECTED,))
