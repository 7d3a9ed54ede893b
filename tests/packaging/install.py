"""Build wheel and sdist, install each in a fresh environment, use it: ``make wheel``.

Prints sizes and times, and what works without a C compiler (NumPy does the work, after one line that says so)
and with one.
"""

import os
import shutil
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path

PROJECT = Path(__file__).parents[2]

#: What an installed package must do: its own version and types, its data, a simulation, an FMU where it can.
USED = """
import sys, warnings
from importlib.metadata import version
from importlib.resources import files
import numpy as np
import hovercontrol as hc
assert hc.__version__ == version("hovercontrol"), (hc.__version__, version("hovercontrol"))
assert (files("hovercontrol") / "py.typed").is_file()
from hovercontrol.documents.scenarios import load_scenario, run_scenario
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    compiled = hc.vehicle("c17_simulation").plant().compile()
    end = compiled.simulate(np.linspace(0.0, 1.0, 11), [2.0, 0.1]).states[:, -1]
print("; ".join(sorted({str(w.message) for w in said})) or "machine code", end.round(4).tolist())
assert all(figure.met for figure in run_scenario(load_scenario("k06-stop")).metrics())
if sys.argv[1] == "cc":
    from hovercontrol.fmi import export_fmu, load
    with load(export_fmu(hc.vehicle("hoverdemon").plant(), "craft.fmu"), step=0.01):
        print("an FMU is exported and read again")
"""


def megabytes(path: Path) -> float:
    """Return the size of a file or of all files in a folder [MB]."""
    files = [path] if path.is_file() else [f for f in path.rglob("*") if f.is_file()]
    return sum(f.stat().st_size for f in files) / 1e6


def used(python: Path, folder: Path, *, compiler: bool) -> str:
    """Return what the installed package says; its commands see no compiler, or those of this machine."""
    here = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "CC")}
    here |= {"HOME": str(folder), "XDG_CACHE_HOME": str(folder / "cache"), "MPLBACKEND": "Agg"}
    if not compiler:
        here["PATH"] = str(python.parent)
    call = [python, "-c", USED, "cc" if compiler else "none"]
    done = subprocess.run(call, cwd=folder, env=here, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr)
    return done.stdout.strip().replace("\n", "\n    ")


def main() -> int:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        subprocess.run([sys.executable, "-m", "build", "--outdir", folder / "dist", PROJECT], check=True)
        for made in sorted((folder / "dist").iterdir()):
            print(f"{made.name}: {megabytes(made):.1f} MB")
            environment = folder / made.suffix[1:]
            venv.create(environment, with_pip=True)
            python = environment / "bin" / "python"
            begin = time.monotonic()
            pinned = ["-c", PROJECT / "constraints.txt"]
            subprocess.run([python, "-m", "pip", "install", "-q", *pinned, made], check=True)
            seconds = time.monotonic() - begin
            site = next(environment.glob("lib/*/site-packages"))
            own, whole = megabytes(site / "hovercontrol"), megabytes(site)
            print(f"  installed in {seconds:.0f} s: {own:.1f} MB, with all it needs {whole:.0f} MB")
            print(f"  without a C compiler:\n    {used(python, folder, compiler=False)}")
            if shutil.which("cc"):
                print(f"  with one:\n    {used(python, folder, compiler=True)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
