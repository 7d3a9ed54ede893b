"""Scripts that name modules by the paths they had go on."""

import importlib
import subprocess
import sys

import pytest

import hovercontrol as hc
from hovercontrol._moved import MOVED


@pytest.mark.parametrize("former", MOVED)
def test_a_former_path_gives_what_lies_there_now(former):
    now = importlib.import_module(f"hovercontrol.{MOVED[former]}")
    with pytest.warns(DeprecationWarning, match=f"hovercontrol.{MOVED[former]} now"):
        sys.modules.pop(f"hovercontrol.{former}", None)
        module = importlib.import_module(f"hovercontrol.{former}")
    public = {k: v for k, v in vars(now).items() if not k.startswith("_")}
    assert public and all(getattr(module, k) is v for k, v in public.items())
    assert now.__name__ == now.__spec__.name == f"hovercontrol.{MOVED[former]}"


def test_no_path_is_both_former_and_in_use():
    for former in MOVED:
        assert importlib.machinery.PathFinder.find_spec(former.rpartition(".")[2], _folder(former)) is None


def _folder(former):
    parent = importlib.import_module(".".join(["hovercontrol", *former.split(".")[:-1]]))
    return list(parent.__path__)


def test_a_name_that_is_a_function_stays_one_when_its_former_module_is_imported():
    code = (
        "import hovercontrol as hc, hovercontrol.interconnect, hovercontrol.sgn; "
        "from hovercontrol.blockmodel import BlockModel; "
        "assert callable(hc.interconnect) and callable(hc.sgn) and BlockModel is hc.BlockModel"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_what_lies_nowhere_is_not_found():
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module("hovercontrol.blocks")
    assert not hasattr(hc, "blocks")
