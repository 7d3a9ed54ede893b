"""``hovercontrol simulate --animate``: an animation beside the results, refused before a run is in vain."""

import json

import pytest

OWN = """
import hovercontrol as hc
v, a = hc.Signal("v", "m/s"), hc.Signal("a", "m/s^2", lower=-1.0, upper=1.0)
cart = hc.Block("cart", [v], [a], [v], derivatives={"v": a.symbol})
plant = hc.vehicle("c17_experiment").plant()
"""


@pytest.mark.slow
def test_a_scenario_is_animated(call, tmp_path):
    done = call("simulate", "k06-turn", "--animate", "films/turn.html", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "wrote films/turn.html" in done.stdout and (tmp_path / "out/k06-turn/log.csv").is_file()
    assert "k06-turn" in (tmp_path / "films/turn.html").read_text()


def test_an_own_craft_is_animated_and_json_names_the_file(call, tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    words = ("simulate", "own.py:plant", "--duration", "2", "--animate", "own.html", "--json")
    done = call(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["animation"] == "own.html" and (tmp_path / "own.html").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("k06-turn", "--animate", "turn.htm"), "turn.htm: expected a file .html, .mp4, .gif, found .htm"),
        (("own.py:cart", "--animate", "cart.html"), "cart: expected the pose of a craft, x, y and psi"),
    ],
)
def test_what_cannot_be_animated_is_refused_in_one_line(call, tmp_path, words, said):
    (tmp_path / "own.py").write_text(OWN)
    done = call("simulate", *words, cwd=tmp_path)
    assert done.returncode == 2 and said in done.stderr.splitlines()[-1]
    assert not list(tmp_path.glob("*.html")) and not list(tmp_path.glob("out/*/*"))
