"""``hovercontrol analyze`` finds the scripts in analyses/ and says what is wrong in one line."""

import pytest

from hovercontrol.app.commands import analyze


def test_the_list_has_every_script_with_its_title(call):
    done = call("analyze", "--list")
    assert done.returncode == 0
    lines = dict(line.split(maxsplit=1) for line in done.stdout.splitlines())
    assert "c17_beta_region" in lines and all(lines.values())


@pytest.mark.slow
def test_an_analysis_leaves_its_files(call, tmp_path):
    done = call("analyze", "c17_beta_region", "--out", str(tmp_path))
    assert done.returncode == 0 and "(19) implies (18)" in done.stdout
    assert {f.suffix for f in tmp_path.glob("[!.]*")} == {".png", ".svg", ".csv", ".txt"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["c17_beta_regoin"], "did you mean 'c17_beta_region'?"),
        (["budgte"], "did you mean 'budget'?"),
        (["budget", "--trial", "k06-trun"], "k06_budget: unknown trial 'k06-trun'; did you mean 'turn'?"),
        ([], "expected an analysis: c17_beta_region"),
        (["c17_beta_region", "--out", "/dev/null/x"], "/dev/null"),
    ],
)
def test_wrong_input_is_one_line(call, words, said):
    done = call("analyze", *words)
    assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1


def test_an_analysis_is_found_without_its_documents_name_where_only_one_ends_so(call, monkeypatch):
    analyses = {name: None for name in ("c17_region", "k06_region", "k06_budget")}
    monkeypatch.setattr(analyze, "known_scripts", lambda: analyses)
    done = call("analyze", "region")
    assert (done.returncode, done.stderr) == (
        2,
        "hovercontrol: analyze: 'region' may be c17_region or k06_region\n",
    )
