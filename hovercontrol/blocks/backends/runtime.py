"""The C runtime of compiled Blocks and FMUs: its folder, and the files that each program needs."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

_SOLVER = (
    *("hc_names.h", "hc_options.h", "hc_numbers.h", "hc_exp.h", "hc_math.h", "hc_model.h"),
    *("hc_rk4.h", "hc_steps.h"),
    *("hc_solver.h", "hc_solver_internal.h", "hc_solver.c", "hc_solver_state.c", "hc_step_length.c"),
    *("hc_methods.h", "hc_methods.c", "hc_dop853.c", "hc_dense.c", "hc_events.c"),
    *("hc_friction.h", "hc_friction.c", "hc_ticks.h", "hc_ticks.c"),
)
_LANES = ("hc_exp.h", "hc_lanes.h", "hc_lanes_math.h")
#: Simulations, sweeps and stepwise simulations of a compiled Block.
SIMULATION = (
    *_SOLVER, *_LANES, "hc_lanes.c", "hc_runs.h",
    *("hc_simulate.h", "hc_simulate.c", "hc_runner.h", "hc_runner.c"),
)  # fmt: skip
#: Simulation of many windows of logs.
SHOOTING = (
    *("hc_names.h", "hc_options.h", "hc_model.h", "hc_rk4.h"), *_LANES,
    *("hc_slopes.h", "hc_shoot.h", "hc_shoot.c"),
)  # fmt: skip
#: States that follow from given signals.
FOLLOWING = ("hc_exp.h", "hc_math.h", "hc_follow.h", "hc_follow.c")
#: An instance of an FMU, for every version of FMI.
INSTANCE = (
    *_SOLVER, "hc_description.h", "hc_delays.h", "hc_instance.h", "hc_instance_internal.h",
    *(f"hc_{job}.c" for job in ("instance", "messages", "values", "partials", "saved_state")),
    *(f"hc_{job}.c" for job in ("event_mode", "model_exchange", "co_simulation")),
)  # fmt: skip
#: Delayed inputs of an FMU.
DELAYS = ("hc_delays.c",)
#: The functions of each version of FMI.
FMI = {
    2: ("hc_fmi2.h", "hc_calls.h", "hc_table.h", "hc_fmi2.c"),
    3: (
        *("hc_fmi3.h", "hc_calls.h", "hc_table.h", "hc_fmi3_unsupported.h"),
        *("hc_fmi3.c", "hc_fmi3_values.c"),
    ),
}
#: An FMU around another one, and the functions of each version of FMI.
AROUND = (
    *_SOLVER, "hc_description.h", "hc_delays.h", "hc_instance.h", "hc_instance_internal.h", "hc_messages.c",
    *("hc_history.h", "hc_history.c", "hc_inner.h", "hc_inner_library.c", "hc_around.h"),
    *(f"hc_around{job}.c" for job in ("", "_values", "_partials", "_exchange", "_steps", "_state")),
)  # fmt: skip
AROUND_FMI = {
    2: (
        *("hc_fmi2.h", "hc_inner_fmi2.h", "hc_inner_shared.h", "hc_inner_fmi2.c", "hc_around_shared.h"),
        *("hc_calls.h", "hc_table.h"),
        "hc_around_fmi2.c",
    ),
    3: (
        *("hc_fmi3.h", "hc_inner_fmi3.h", "hc_inner_shared.h", "hc_inner_fmi3.c", "hc_around_shared.h"),
        *("hc_calls.h", "hc_table.h", "hc_fmi3_unsupported.h"),
        *("hc_around_fmi3.c", "hc_around_fmi3_values.c"),
    ),
}

_PACKAGE = Path(__file__).parents[2]
#: The runtime is inside the package in an installed wheel, and next to it in a checkout.
_PLACES = (_PACKAGE / "fmu", _PACKAGE.parent / "fmu")


def runtime_folder() -> Path:
    """Return the folder of the C runtime.

    Raises
    ------
    FileNotFoundError
        If the package was copied without it.

    Examples
    --------
    >>> (runtime_folder() / "hc_solver.c").is_file()
    True
    """
    for place in _PLACES:
        if (place / "hc_model.h").is_file():  # other folders of this name do not have it
            return place
    raise FileNotFoundError(f"the C runtime of hovercontrol is neither in {_PLACES[0]} nor in {_PLACES[1]}")


def runtime_files(names: Iterable[str]) -> dict[str, str]:
    """Return files of the C runtime by name.

    Parameters
    ----------
    names : iterable of str
        Names of sources and headers.

    Raises
    ------
    FileNotFoundError
        If one is missing.

    Examples
    --------
    >>> runtime_files(["hc_model.h"])["hc_model.h"].splitlines()[0][:30]
    '/* Interface of a generated mo'
    """
    folder = runtime_folder()
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}
