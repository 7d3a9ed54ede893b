"""The names of the package's top level: the same functions, whatever was imported before."""

import subprocess
import sys

import pytest

IMPORTS = (
    "import hovercontrol as hc",
    "from hovercontrol.identify import identify",
    "import hovercontrol.identify",
    "import hovercontrol.identify.study",
    "from hovercontrol.identify.study import Study",
    "import hovercontrol.log_check",
    "from hovercontrol import identify, diagnose, check, read_log",
)
SAME = """
import inspect, hovercontrol as hc
from hovercontrol.discrepancy import diagnose
from hovercontrol.identify import free_run, identify
from hovercontrol.identify.fit import identify as own
from hovercontrol.log_check import check
from hovercontrol.logs import read_log
assert (hc.identify, hc.diagnose, hc.check, hc.read_log) == (identify, diagnose, check, read_log)
assert own is identify and "coefficients" in inspect.signature(hc.identify).parameters
assert callable(free_run) and "identify" in dir(hc)
"""


@pytest.mark.parametrize("first", IMPORTS)
def test_the_functions_of_logs_are_at_the_top_after_any_import(first):
    early = "import hovercontrol as hc; assert inspect.isfunction(hc.identify)"
    for code in (f"{first}\n{SAME}", f"import inspect\n{first}\n{early}\n{first}\n{SAME}"):
        subprocess.run([sys.executable, "-c", code], check=True)


def test_the_top_level_imports_nothing_before_it_is_asked_for():
    code = "import sys, hovercontrol; assert 'sympy' not in sys.modules; assert 'numpy' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
