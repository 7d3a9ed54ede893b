"""The C sources of a corrected FMU: the Block around the given FMU, its tables, and the runtime."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping

from hovercontrol.blocks.backends.c import c_source
from hovercontrol.blocks.backends.c_delays import delays_source
from hovercontrol.blocks.backends.c_function import Element, Function, Names, Result
from hovercontrol.blocks.backends.runtime import AROUND, AROUND_FMI, DELAYS, runtime_files
from hovercontrol.blocks.block import Block
from hovercontrol.blocks.delays import undelayed
from hovercontrol.blocks.expressions import Expressions
from hovercontrol.fmi.corrected.description import Description
from hovercontrol.fmi.corrected.given import Given
from hovercontrol.fmi.corrected.joined import Joined
from hovercontrol.fmi.corrected.partials import differentiable, known_sources
from hovercontrol.fmi.exporter.sources import _array, _number, _options


def block_sources(given: Given, joined: Joined, identifier: str) -> dict[str, str]:
    """Return the sources of the Block and the runtime by file name."""
    late = bool(joined.late_given)
    files = runtime_files([*AROUND, *AROUND_FMI[given.version], *(DELAYS if late else ())])
    files["hc_options.h"] = _options(identifier, late)
    files["model.c"] = c_source(
        undelayed(joined.block), friction="smooth", partials=differentiable(given, joined)
    )
    if late:
        given_late = Expressions(joined.late_given.items())
        files["delays.c"] = delays_source(joined.block.unchecked(delays=given_late))
    return files


def token_of(given: Given, joined: Joined, start: Mapping[str, float], files: Mapping[str, str]) -> str:
    """Return the corrected FMU's token, a hash of its content."""
    digest = hashlib.sha256(given.description + joined.block.content_hash.encode())
    digest.update(repr(sorted(start.items())).encode())
    for name, data in sorted(given.files.items()):
        digest.update(f"\0{name}\0".encode() + hashlib.sha256(data).digest())
    for name, text in sorted(files.items()):
        digest.update(f"\0{name}\0{text}".encode())
    h = digest.hexdigest()
    return f"{{{h[:8]}-{h[8:12]}-{h[12:16]}-{h[16:20]}-{h[20:32]}}}"


def table_source(
    given: Given, joined: Joined, described: Description, token: str, start: Mapping[str, float]
) -> str:
    """Return ``around.c``: what hc_around.h calls hc_surroundings."""
    block = joined.block
    moving = block.states[: block.n_continuous]
    fixed = {s for e in block.delays.values() for s in e.free_symbols}
    given_starts = [float(v.typed.get("start", "0")) for v in joined.driven]
    starts = [*(s.start for s in block.states), *given_starts, *(p.start for p in block.parameters)]
    counts = (joined.driven, joined.sources, joined.measured, joined.added)
    n_driven, n_sources, n_measured, n_added = map(len, counts)
    inner = [n for n in start if given.by_name[n] not in joined.driven]
    arrays = [v for v in given.variables if v.is_real and v.size != 1]
    late = list(joined.late_sources)
    sources = block.inputs[len(joined.driven) :]
    derivatives = given.derivatives()
    partials = int(differentiable(given, joined))
    lists = {
        "driven": ("unsigned", [str(v.reference) for v in joined.driven]),
        "source": ("unsigned", [str(v.reference) for v in joined.sources]),
        "measured": ("unsigned", [str(r) for r in described.measured]),
        "added_state": ("int", [str(k) for k in joined.added]),
        "added": ("unsigned", [str(derivatives[k][1].reference) for k in joined.added]),
        "start": ("double", [_number(x) for x in starts]),
        "lower": ("double", [_number(p.lower) for p in block.parameters]),
        "upper": ("double", [_number(p.upper) for p in block.parameters]),
        "nominal": ("double", [_number(s.nominal) for s in moving]),
        "fixed": ("char", [str(int(p.symbol in fixed)) for p in block.parameters]),
        "names": ("char *const", [f'"{p.name}"' for p in block.parameters]),
        "set": ("unsigned", [str(given.by_name[n].reference) for n in inner]),
        "set_value": ("double", [_number(start[n]) for n in inner]),
        "array": ("unsigned", [str(v.reference) for v in arrays]),
        "array_size": ("unsigned", [str(v.size) for v in arrays]),
        "source_known": ("char", [str(int(k)) for k in known_sources(given, joined)]),
        "late_source": ("int", [str(k) for k in late]),
        "late_start": ("double", [_number(sources[k].start) for k in late]),
    }  # fmt: skip
    made = {name: _array(kind, name, values) for name, (kind, values) in lists.items()}
    at = {name: where for name, (_, where) in made.items()}
    steps = given.part.get("canHandleVariableCommunicationStepSize") in ("true", "1")
    entries = [
        f'"{described.identifier}", "{token}"',
        f'"{given.identifier}", "{_escaped(given.token)}"',
        f"{n_driven}, {joined.n_early}, {n_sources}, {n_measured}, {n_added}",
        ", ".join(at[n] for n in ("driven", "source", "measured", "added_state", "added")),
        f"{described.first}, {len(derivatives)}, {given.indicators}",
        ", ".join(at[n] for n in ("start", "lower", "upper", "nominal", "fixed", "names")),
        f"{len(inner)}, {at['set']}, {at['set_value']}",
        f"{len(arrays)}, {at['array']}, {at['array_size']}",
        f"{int(given.exchange is not None)}, {int(steps)}, {partials}, {at['source_known']}",
        f"{len(late)}, {at['late_source']}, {'late_seconds' if late else 'NULL'}, {at['late_start']}",
        "1e-6, 1e-9",
    ]
    return (
        "/* What stands around the FMU inside. Generated by hovercontrol. */\n"
        '#include <math.h>\n#include <stddef.h>\n\n#include "hc_around.h"\n\n'
        + "".join(text for text, _ in made.values())
        + (_late_seconds(joined) if late else "")
        + "\nconst hc_around_table hc_surroundings = {\n    "
        + ",\n    ".join(entries)
        + "};\n"
    )


def _late_seconds(joined: Joined) -> str:
    plain: Block = undelayed(joined.block)
    results = [Result(Element("at", k), e) for k, e in enumerate(joined.late_sources.values())]
    arguments = (("const double *", "param"),)
    return Function(plain, Names(plain), results).text("late_seconds", "at", arguments=arguments) + "\n"


def _escaped(text: str) -> str:
    """Return the inside of a C string: printable ASCII as it is, other bytes in octal."""
    plain = (chr(b) if 32 <= b < 127 and chr(b) not in '"\\?' else f"\\{b:03o}" for b in text.encode())
    return "".join(plain)
