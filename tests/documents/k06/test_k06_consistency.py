"""The script of the navigation filters' Monte Carlo: tables, pictures, and what it finds."""

import numpy as np
import pyarrow.csv
import pytest

from hovercontrol.documents.k06 import consistency
from hovercontrol.documents.k06.consistency_runs import heading_model, model_errors, motion_model


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    told = []
    files = consistency.main(tmp_path_factory.mktemp("out"), told.append, runs=40, seconds=3.0)
    return {f.suffix: f for f in files}, told


@pytest.mark.slow
def test_it_leaves_a_picture_a_table_and_its_findings(left):
    files, told = left
    assert set(files) == {".png", ".svg", ".csv", ".txt"}
    assert all(f.stem == "k06_consistency" and f.stat().st_size > 500 for f in files.values())
    assert told == sorted(told) and told[-1] == pytest.approx(1.0)


@pytest.mark.slow
def test_filters_are_consistent_with_their_sensors_but_not_with_the_printed_matrices(left):
    files, _ = left
    rows = pyarrow.csv.read_csv(files[".csv"]).to_pylist()
    found = {(r["filter"], r["covariances"]): r for r in rows}
    names = list(dict.fromkeys(r["filter"] for r in rows))
    assert len(names) == 6
    for name in names:
        stated = found[name, "of the stated sensors"]
        printed = found[name, "with K06's printed Q1, Q2"]
        assert stated["NEES inside"] >= 0.85 and stated["NIS inside"] >= 0.8  # 40 runs
        assert stated["mean NIS"] == pytest.approx(1.0, abs=0.15)
        assert printed["NEES inside"] < 0.8 and printed["NIS inside"] < stated["NIS inside"]
    for name in names[:2]:
        assert found[name, "all of K06's as printed, and errors drawn from them"]["NEES inside"] >= 0.9
    said = files[".txt"].read_text()
    for name in names:
        inside = found[name, "of the stated sensors"]["NEES inside"]
        assert f"{name}: NEES inside {inside:.1%}" in said


@pytest.mark.parametrize("which", ["heading", "motion"])
def test_errors_of_k06s_models_have_the_covariance_of_their_recursion(rng, which):
    """P <- F P F^T + G Q G^T with the matrices of (3.31) and (3.32) as the thesis prints them."""
    dt, psi = 0.1, 0.7
    if which == "heading":
        step, P, Q = heading_model(dt), np.array([0.04, 0.09]), np.array([0.01, 0.02])
        F, G = np.array([[1, dt], [0, 1]]), np.eye(2)
    else:
        step = motion_model(np.full(30, psi), dt)
        P, Q = np.array([1.0, 2.0, 0.1, 0.2, 0.5, 0.3]), np.array([0.1, 0.2, 0.05, 0.02])
        eye, none = np.eye(2), np.zeros((2, 2))
        B = np.array([[np.cos(psi), -np.sin(psi)], [np.sin(psi), np.cos(psi)]])
        F = np.block([[eye, none, dt * B], [dt * eye, eye, dt**2 / 2 * B], [none, none, eye]])
        G = np.block([[B, none], [none, none], [none, eye]])
    drawn = model_errors(rng, step, P, Q, ticks=30, runs=40_000)[:, -1]
    wanted = np.diag(P)
    for _ in range(29):
        wanted = F @ wanted @ F.T + G @ np.diag(Q) @ G.T
    size = np.sqrt(np.diag(wanted))
    assert np.abs((np.cov(drawn) - wanted) / np.outer(size, size)).max() < 0.03
