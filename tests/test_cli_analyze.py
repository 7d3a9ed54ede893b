"""``hovercontrol analyze`` finds the scripts in analyses/ and says what is wrong in one line."""

import pytest

from hovercontrol.cli import main
from hovercontrol.commands import analyze


def run(monkeypatch, capsys, *words):
    monkeypatch.setattr("sys.argv", ["hovercontrol", *words])
    with pytest.raises(SystemExit) as end:
        main()
    return end.value.code, *capsys.readouterr()


def test_the_list_has_every_script_with_its_title(monkeypatch, capsys):
    status, out, _ = run(monkeypatch, capsys, "analyze", "--list")
    assert status == 0
    lines = dict(line.split(maxsplit=1) for line in out.splitlines())
    assert "c17_beta_region" in lines and all(lines.values())


def test_an_analysis_leaves_its_files(monkeypatch, capsys, tmp_path):
    status, out, _ = run(monkeypatch, capsys, "analyze", "c17_beta_region", "--out", str(tmp_path))
    assert status == 0 and "(19) implies (18)" in out
    assert {f.suffix for f in tmp_path.iterdir()} == {".png", ".svg", ".csv", ".txt"}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["c17_beta_regoin"], "did you mean 'c17_beta_region'?"),
        (["budgte"], "did you mean 'budget'?"),
        (["budget", "k06-trun"], "k06_budget: unknown trial 'k06-trun'; did you mean 'turn'?"),
        ([], "expected an analysis: c17_beta_region"),
        (["c17_beta_region", "--out", "/dev/null/x"], "/dev/null"),
    ],
)
def test_wrong_input_is_one_line(monkeypatch, capsys, words, said):
    status, _, err = run(monkeypatch, capsys, "analyze", *words)
    assert status == 2 and said in err and err.count("\n") == 1


def test_an_analysis_is_found_without_its_documents_name_where_only_one_ends_so(monkeypatch, capsys):
    analyses = {name: None for name in ("c17_region", "k06_region", "k06_budget")}
    monkeypatch.setattr(analyze, "_scripts", lambda: analyses)
    status, _, err = run(monkeypatch, capsys, "analyze", "region")
    assert (status, err) == (2, "hovercontrol: analyze: 'region' may be c17_region or k06_region\n")
