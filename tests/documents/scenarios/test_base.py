"""A scenario on a base is that one but for its own keys; estimates begin elsewhere; a view is poor."""

import pytest

from hovercontrol.base.errors import InputError
from hovercontrol.documents.scenarios import load_scenario, run_scenario


def write(folder, name, text):
    (folder / f"{name}.toml").write_text(text)
    return folder / f"{name}.toml"


def test_a_scenario_takes_from_its_base_what_it_does_not_say(tmp_path):
    base, mine = (
        load_scenario("table2"),
        write(tmp_path, "mine", "[scenario]\nbase = 'table2'\ntitle = 'mine'\n[sampling]\nseed = 7\n"),
    )
    found = load_scenario(mine)
    assert (found.title, found.sampling.seed, found.name) == ("mine", 7, "mine")
    assert found.sampling.command == base.sampling.command and found.phases == base.phases
    assert found.metrics == base.metrics and found.reference == base.reference


def test_lists_and_sections_with_a_kind_are_taken_whole(tmp_path):
    text = (
        "[scenario]\nbase = 'table1'\n[reference]\nkind = 'circle'\nradius = 2.0\n[[phase]]\nuntil = 50.0\n"
    )
    found = load_scenario(write(tmp_path, "mine", text))
    assert found.reference == {"kind": "circle", "radius": 2.0} and len(found.phases) == 1


def test_a_file_may_be_a_base_and_bases_have_bases(tmp_path):
    write(tmp_path, "first", "[scenario]\nbase = 'table1'\nstep = 0.02\n")
    found = load_scenario(write(tmp_path, "second", "[scenario]\nbase = 'first.toml'\ntitle = 'two'\n"))
    assert (found.step, found.title) == (0.02, "two") and found.estimator is not None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[scenario]\nbase = 'tabel1'\n", "did you mean 'table1'"),
        ("[scenario]\nbase = 'none.toml'\n", "none.toml: expected a TOML file, there is no such file"),
        ("[scenario]\nbase = 'mine.toml'\n", "has this scenario as its own base"),
        ("[scenario]\nbase = 3\n", "scenario.base must be text"),
        ("[scenario]\nbase = 'table1'\n[estimator]\nfirst = { thurst = 1.0 }\n", "did you mean 'thrust'"),
        ("[scenario]\nbase = 'table2'\n[sampling]\npoor_view = { raduis = 1.0 }\n", "did you mean 'radius'"),
    ],
)
def test_a_wrong_base_is_refused_in_one_line(tmp_path, text, said):
    with pytest.raises(InputError, match=said) as refused:
        load_scenario(write(tmp_path, "mine", text))
    assert "\n" not in str(refused.value)


@pytest.mark.slow
def test_estimates_that_begin_at_zero_find_the_truth():
    run = run_scenario(load_scenario("table1-transient"))
    assert [m.metric.name for m in run.metrics() if not m.met] == []
    assert run.estimates()["yaw_coulomb"][0] == 0.0
    assert run.estimates()["yaw_coulomb"][-1] == pytest.approx(0.415, abs=1e-3)


def test_where_the_sets_are_dependent_estimates_converge_to_wrong_constants():
    """C17 section V: "estimates converge to a constant, although they are not guaranteed to" be correct."""
    run = run_scenario(load_scenario("c17-dependent"))
    late = run.time >= 50.0
    assert max(float(v[late].max() - v[late].min()) for v in run.estimates().values()) < 1e-5
    assert abs(run.estimates()["surge_coulomb"][-1] - 1.35) > 0.2


@pytest.mark.slow
def test_outliers_ask_for_more_thrust_than_there_is():
    run = run_scenario(load_scenario("table2-outliers"))
    later = run.time > 3.0
    assert run.columns["thrust_asked"][later].max() > 6.1 and run.columns["thrust"].max() <= 6.1
    assert [m.metric.name for m in run.metrics() if not m.met] == []
