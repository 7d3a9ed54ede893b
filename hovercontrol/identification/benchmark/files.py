"""A case as files: logs, the model, and the answer in a file apart."""

from __future__ import annotations

import json
from pathlib import Path

from hovercontrol.base.folders import write_folder
from hovercontrol.identification.benchmark.cases import Case, benchmark_case

_MODEL = '''"""The model of the benchmark's case {name}: it may lack something."""

from hovercontrol.identification.benchmark.cases import given_model

MODEL = given_model({machine!r}, {values})
'''


def save_case(name: str, folder: Path, shown: str = "") -> list[Path]:
    """Write a case into a folder, and its answer into the folder ``FOLDER.answer`` beside it.

    Parameters
    ----------
    name : str
        Of the case.
    folder : path
    shown : str, optional
        A neutral name for the files, of a blind case.

    Returns
    -------
    list of Path
        Those of the case, then the answer.
    """
    case = benchmark_case(name)
    files = save_logs(case, folder, shown or name)
    answers = folder.with_name(f"{folder.name}.answer")
    return [*files, *write_folder(answers, lambda place: _write_answer(case, place))]


def save_logs(case: Case, folder: Path, shown: str) -> list[Path]:
    """Write train.csv, holdout.csv and model.py of a case, under the name `shown`."""
    values = {k: float(v) for k, v in case.model.coefficients().items()}
    text = _MODEL.format(name=shown, machine=case.name.partition(".")[0], values=values)

    def write(place: Path) -> None:
        case.train[0].save(place / "train.csv")
        case.holdout.save(place / "holdout.csv")
        (place / "model.py").write_text(text, encoding="utf-8")

    return write_folder(folder, write)


def _write_answer(case: Case, place: Path) -> None:
    (place / "answer.json").write_text(json.dumps(answer_sheet(case), indent=2) + "\n", encoding="utf-8")


def answer_sheet(case: Case) -> dict[str, object]:
    """Return the truth of a case, as JSON has it."""
    truth = case.truth
    known = truth.coefficient == truth.coefficient  # NaN has no place in JSON
    return {
        "case": case.name,
        "lacks": truth.name,
        "terms": truth.terms,
        "coefficient": truth.coefficient if known else None,
    }
