"""Run the benchmarks named on the command line, or all, and print one table each with the machine's name."""

from __future__ import annotations

import os
import platform
import sys
from pathlib import Path

import hovercontrol
from benchmarks import (
    adversary,
    autopilot,
    cluster,
    cockpit,
    compiled,
    control,
    coupled,
    criteria,
    derive,
    diagnose_profile,
    discrepancy,
    do_step,
    fleet,
    fmu,
    fmu_models,
    fmu_rates,
    fused,
    gpu,
    lacking,
    large_log,
    learn,
    log_formats,
    monitor,
    monitor_logs,
    monitor_noise,
    monitor_rows,
    monitor_sizes,
    monitor_tick,
    monitor_watch,
    mpc,
    mpc_plants,
    navigation,
    outside,
    own_machines,
    real_logs,
    regions,
    startup,
    steering,
    step,
    tables,
)

ALL = {
    "adversary": adversary,
    "tables": tables,
    "fused": fused,
    "compiled": compiled,
    "outside": outside,
    "own_machines": own_machines,
    "control": control,
    "coupled": coupled,
    "cluster": cluster,
    "cockpit": cockpit,
    "do_step": do_step,
    "step": step,
    "learn": learn,
    "gpu": gpu,
    "steering": steering,
    "startup": startup,
    "fmu": fmu,
    "fmu_models": fmu_models,
    "fmu_rates": fmu_rates,
    "derive": derive,
    "fleet": fleet,
    "monitor": monitor,
    "monitor_logs": monitor_logs,
    "monitor_noise": monitor_noise,
    "monitor_rows": monitor_rows,
    "monitor_sizes": monitor_sizes,
    "monitor_tick": monitor_tick,
    "monitor_watch": monitor_watch,
    "real_logs": real_logs,
    "lacking": lacking,
    "diagnose_profile": diagnose_profile,
    "discrepancy": discrepancy,
    "criteria": criteria,
    "regions": regions,
    "large_log": large_log,
    "log_formats": log_formats,
    "autopilot": autopilot,
    "navigation": navigation,
    "mpc": mpc,
    "mpc_plants": mpc_plants,
}


def machine() -> str:
    cpu = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        models = [
            x.split(":", 1)[1].strip() for x in info.read_text().splitlines() if x.startswith("model name")
        ]
        cpu = models[0] if models else cpu
    return f"{platform.node()}: {cpu}, {os.cpu_count()} cores, Python {platform.python_version()}"


def main(names: list[str]) -> int:
    unknown = [name for name in names if name not in ALL]
    if unknown:
        print(f"benchmarks: unknown {unknown[0]!r}; known: {', '.join(ALL)}", file=sys.stderr)
        return 2
    print(f"hovercontrol {hovercontrol.__version__} on {machine()}")
    met = True
    for name in names or list(ALL):
        print(f"\n{ALL[name].__doc__.strip()}")
        for what, value, wanted, ok in ALL[name].rows():
            mark = {True: "ok", False: "NOT REACHED", None: ""}[ok]
            print(f"  {what:58} {value:>34}   {wanted:24} {mark}", flush=True)
            met = met and ok is not False
    return 0 if met else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
