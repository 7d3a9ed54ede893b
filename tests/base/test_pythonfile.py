"""What a user's Python file defines is found; what is wrong with it is said in one line."""

import sys

import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.base.pythonfile import from_python, names_python
from hovercontrol.craft.models.blockmodel import BlockModel
from hovercontrol.craft.models.model import Model

CART = """
import hovercontrol as hc
from hovercontrol.craft.models.blockmodel import BlockModel
from beside import GAIN

v, k = hc.Signal("v", "m/s"), hc.Signal("k", "1/s", start=GAIN)
CART = BlockModel(hc.Block("cart", [v], [], [v], [k], {"v": -k.symbol * v.symbol}))
"""


@pytest.fixture
def cart(tmp_path):
    (tmp_path / "beside.py").write_text("GAIN = 2.5\n")
    file = tmp_path / "my_cart.py"
    file.write_text(CART)
    return file


@pytest.mark.parametrize("name", [":CART", ""])
def test_a_model_is_found_by_name_and_alone(cart, name):
    path = list(sys.path)
    found = from_python(f"{cart}{name}", BlockModel, Model)
    assert found.coefficients() == {"k": 2.5}
    assert sys.path == path


@pytest.mark.parametrize(
    ("end", "text"),
    [
        (":CARD", "defines no 'CARD'; did you mean 'CART'?"),
        (":k", "expected a BlockModel or Model, found a Signal; known: CART"),
    ],
)
def test_wrong_names(cart, end, text):
    with pytest.raises(InputError) as error:
        from_python(f"{cart}{end}", BlockModel, Model)
    assert text in str(error.value)


@pytest.mark.parametrize(
    ("code", "text"),
    [
        ("x = 1\ny = x / 0\n", "bad.py, line 2: ZeroDivisionError: division by zero"),
        ("x = (\n", "bad.py, line 1: SyntaxError: '(' was never closed"),
        ("x = 1\n", "bad.py: expected FILE.py:NAME of a Model; the file defines none"),
        ("x = 1\nimport sys\nsys.exit(0)\n", "bad.py, line 3: SystemExit: 0"),
        ("raise GeneratorExit('enough')\n", "bad.py, line 1: GeneratorExit: enough"),
        ("raise ValueError\n", "bad.py, line 1: ValueError: no message"),
    ],
)
def test_wrong_files(tmp_path, code, text):
    (tmp_path / "bad.py").write_text(code)
    with pytest.raises(InputError) as error:
        from_python(f"{tmp_path}/bad.py", Model)
    assert str(error.value).endswith(text) and "\n" not in str(error.value)


def test_no_file():
    with pytest.raises(InputError, match=r"nowhere\.py: .*there is no such file"):
        from_python("nowhere.py:X", Model)


def test_a_toml_file_is_no_python():
    assert not names_python("craft.toml") and not names_python("py.toml")
