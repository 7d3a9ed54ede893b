"""``hovercontrol benchmark``: score tools that find missing physics."""

from __future__ import annotations

import hashlib
import json as json_module
import os
from pathlib import Path
from typing import Annotated

import typer

from hovercontrol.app.commands import names, options
from hovercontrol.base import file_list
from hovercontrol.base.errors import InputError
from hovercontrol.base.files import check_folder
from hovercontrol.base.folders import own_folder, write_folder

EXAMPLE = "Example: hovercontrol benchmark --tool hovercontrol,sindy,arx --jobs 2 --out out/benchmark"


def benchmark(
    out: options.Out = None,
    list_cases: Annotated[
        bool, typer.Option("--list", help="List the cases of the edition and exit.")
    ] = False,
    case: Annotated[
        str,
        typer.Option(
            "--case",
            help="Write the logs and the model of one case, and its answer in another folder; "
            "with --tool score it alone.",
        ),
    ] = "",
    edition: Annotated[
        str,
        typer.Option("--edition", help="small or full.", autocompletion=names.of("small", "full")),
    ] = "small",
    tool: Annotated[
        str,
        typer.Option(
            "--tool",
            help="Tools, separated by commas: hovercontrol (default), sindy, arx, FILE.py:FUNCTION.",
            autocompletion=names.of("hovercontrol", "sindy", "arx"),
        ),
    ] = "",
    blind: Annotated[
        str, typer.Option("--blind", metavar="KEY", help="Draw order and seeds of the cases from a secret.")
    ] = "",
    logs_only: Annotated[
        bool, typer.Option("--logs", help="Write the logs and models of all cases; run no tool.")
    ] = False,
    first: Annotated[
        int, typer.Option("--first", help="Use the first cases only (default: all).", min=1)
    ] = 1_000_000,
    jobs: Annotated[
        int, typer.Option("--jobs", help="Processes (default: one for each core).", min=1)
    ] = os.cpu_count() or 1,
    json: options.Json = False,
) -> int:
    """Score tools on logs of machines whose models are complete or lack one or more effects.

    Each tool gets the model, a training log and a held-out log. Its answer is scored by fixed rules:
    detection, name or form, equation, coefficient, false names, held-out error 0.2 and 1 s ahead.

    With --case and --tool one case is scored; with --case alone its logs and model are written.

    Cases and seeds are public. With --blind KEY they follow from a secret: --logs then writes cases with
    neutral names, and the answers to OUT.answer. The same key with --tool scores a tool on them.

    Writes result.json, table.csv and table.png. Finished cases are kept in OUT.cases: a run that was
    stopped continues when it is started again.
    """
    from hovercontrol.identification.benchmark.cases import benchmark_names, blind_names, lacks, parsed
    from hovercontrol.identification.benchmark.files import save_case

    cases = blind_names(blind, edition) if blind else {name: name for name in benchmark_names(edition)}
    cases = dict(list(cases.items())[:first])
    if list_cases:
        options.show_list({name: "blind" if blind else f"lacks {lacks(name)}" for name in cases}, json)
        return 0
    out = out or Path("out") / "benchmark"
    check_folder(out)
    if logs_only and tool:
        raise InputError("benchmark: --logs runs no tool; expected --logs or --tool")
    if case and tool:
        real = cases.get(case, case)
        parsed(real)
        return _score({case: real}, _tools(tool), out, jobs, blind, json)
    if case:
        real = cases.get(case, case)
        shown = case if blind and case in cases else ""
        saved = save_case(real, out, shown)
        content = {"case": case} if json else None
        options.show("" if blind else f"{case}: the answer is in {out.name}.answer", saved[:3], out, content)
        return 0
    if logs_only:
        return _write_all(cases, out, bool(blind), json)
    return _score(cases, _tools(tool or "hovercontrol"), out, jobs, blind, json)


def _tools(text: str) -> list[str]:
    from hovercontrol.identification.benchmark.tools import tool_of

    tools = options.listed(text, "--tool") or []
    for name in tools:
        tool_of(name)
        if tools.count(name) > 1:
            raise InputError(f"benchmark: --tool {name} is given twice")
    return tools


def _write_all(cases: dict[str, str], out: Path, blind: bool, json: bool) -> int:
    """Write all cases, each into a folder of its own, and the answers into a folder beside."""
    from hovercontrol.identification.benchmark.cases import benchmark_case
    from hovercontrol.identification.benchmark.files import answer_sheet, save_logs

    sheet = {}
    own_folder(out)
    with options.progress_bar("benchmark", len(cases)) as report:
        for done, (shown, name) in enumerate(cases.items()):
            report(done, shown)
            found = benchmark_case(name)
            save_logs(found, out / shown, shown if blind else name)
            sheet[shown] = answer_sheet(found)
    text = json_module.dumps(sheet, indent=2) + "\n"
    answers = out.with_name(f"{out.name}.answer")
    write_folder(answers, lambda place: (place / "answers.json").write_text(text, encoding="utf-8"))
    digest = hashlib.sha256(text.encode()).hexdigest()
    if json:
        options.show("", [], out, {"cases": list(cases), "answers": str(answers), "sha256": digest})
    else:
        print(f"wrote {len(cases)} cases to {out}, answers.json to {answers}; its SHA-256 is {digest}")
    return 0


def _score(cases: dict[str, str], tools: list[str], out: Path, jobs: int, blind: str, json: bool) -> int:
    from hovercontrol.identification.benchmark.display import csv_table, table_figure, text_table
    from hovercontrol.identification.benchmark.run import run_cases, table

    kept = out.resolve().with_name(f"{out.resolve().name}.cases")
    file_list.refuse_others(kept)
    own_folder(kept)
    total = len(cases) * len(tools)
    with options.progress_bar("benchmark", total) as report:
        rows = run_cases(list(cases.values()), tools, kept, jobs, lambda n: report(n, f"{n} of {total}"))
    found = table(rows)
    back = {name: shown for shown, name in cases.items()}
    content = {"cases": [{**r, "case": back[r["case"]]} if blind else r for r in rows], "table": found}

    def write(place: Path) -> None:
        (place / "result.json").write_text(_text(content), encoding="utf-8")
        (place / "table.csv").write_text(csv_table(found), encoding="utf-8")
        table_figure(found).savefig(place / "table.png", dpi=150)

    saved = write_folder(out, write)
    options.show(text_table(found), saved, out, content if json else None)
    return 0


def _text(content: object) -> str:
    from hovercontrol.base.plain_json import json_text, plain

    return json_text(plain(content))
