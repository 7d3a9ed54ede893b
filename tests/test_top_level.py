"""The names of the package's top level: the same functions, whatever was imported before."""

import json
import os
import subprocess
import sys

import pytest

IMPORTS = (
    "import hovercontrol as hc",
    "from hovercontrol.identification.identify.study import Study",
    "import hovercontrol.identification.check",
    "from hovercontrol import identify, diagnose, check, read_log",
)
SAME = """
import inspect, hovercontrol as hc
from hovercontrol.identification.diagnose import diagnose
from hovercontrol.identification.identify import free_run, identify
from hovercontrol.identification.identify.fit import identify as own
from hovercontrol.identification.check import check
from hovercontrol.logs import read_log
assert (hc.identify, hc.diagnose, hc.check, hc.read_log) == (identify, diagnose, check, read_log)
assert own is identify and "coefficients" in inspect.signature(hc.identify).parameters
assert callable(free_run) and "identify" in dir(hc)
"""


#: Runs each code in a process of its own, which has loaded what others wrote: that takes most of the time.
FORKS = """
import json, os, sys, traceback
import control, numpy, pint, pyarrow.csv, scipy.optimize, scipy.signal, sympy
ends = []
for code in json.load(sys.stdin):
    child = os.fork()
    if not child:
        try:
            exec(code, {})
            os._exit(0)
        except BaseException:
            traceback.print_exc()
            sys.stderr.flush()
            os._exit(1)
    ends.append(os.waitpid(child, 0)[1])
assert not any(name.startswith("hovercontrol") for name in sys.modules)
print(json.dumps(ends))
"""


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_the_functions_of_logs_are_at_the_top_after_any_import():
    early = "import hovercontrol as hc; assert inspect.isfunction(hc.identify)"
    codes = [f"import inspect\n{first}\n{early}\n{first}\n{SAME}" for first in IMPORTS]
    call = [sys.executable, "-c", FORKS]
    done = subprocess.run(call, input=json.dumps(codes), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    failed = [code for code, end in zip(codes, json.loads(done.stdout), strict=True) if end]
    assert not failed, done.stderr


def test_the_top_level_imports_nothing_before_it_is_asked_for():
    code = "import sys, hovercontrol; assert 'sympy' not in sys.modules; assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
