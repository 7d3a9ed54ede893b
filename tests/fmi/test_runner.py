"""An FMU step by step is the Block it was exported from, step by step."""

import numpy as np
import pytest

import hovercontrol as hc
import hovercontrol.fmi
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.backends.compiler import NoCompilerError, find_compiler

CRAFT = hc.vehicle("c17_experiment").plant()


@pytest.fixture(scope="module", params=[2, 3])
def fmu(request, tmp_path_factory):
    try:
        find_compiler()
    except NoCompilerError as error:
        pytest.skip(f"{error}: no FMU can be built")
    path = CRAFT.to_fmu(
        tmp_path_factory.mktemp("fmu") / "plant.fmu", version=request.param, step=0.01, friction="events"
    )
    with hovercontrol.fmi.load(path) as system:
        yield system


def test_its_steps_are_those_of_the_block(fmu):
    params = {"plant.yaw_coulomb": 0.4}
    block = CRAFT.compile(friction="events").start(params=params, inputs=[1.0, 0.0], time=2.0)
    with fmu.start(None, params, inputs={"thrust": 1.0}, time=2.0) as run:
        assert run.input_labels == block.input_labels and run.output_labels == block.output_labels
        assert run.params["plant.yaw_coulomb"] == 0.4
        for k in range(60):
            u, dt = [3.0, 0.3 * np.sin(k)], 0.005 + 0.005 * (k % 4)
            np.testing.assert_allclose(run.step(u, dt), block.step(u, dt), 1e-5, 1e-6)
        assert run.time == block.time
        saved, kept = run.save(), block.save()
        first = [run.step([1.0, -0.2], 0.02) for _ in range(5)]
        run.restore(saved)
        block.restore(kept)
        again = [run.step([1.0, -0.2], 0.02) for _ in range(5)]
        assert np.array_equal(first, again)
        np.testing.assert_allclose(
            again[-1], [block.step([1.0, -0.2], 0.02) for _ in range(5)][-1], 1e-5, 1e-6
        )


def test_two_runs_and_the_system_do_not_disturb_each_other(fmu):
    one, two = fmu.start(), fmu.start()
    expected = one.step([2.0, 0.1], 0.1)
    one.step([5.0, 0.4], 0.3)
    assert np.array_equal(two.step([2.0, 0.1], 0.1), expected)
    saved = one.save()
    with pytest.raises(InputError, match="snapshot is of another version or instance of it"):
        two.restore(saved)
    one.close()
    one.close()
    with pytest.raises(InputError, match="FMU 'plant' is closed"):
        one.step([2.0, 0.1], 0.1)


@pytest.mark.parametrize(
    ("work", "line"),
    [
        (lambda f: f.start({"u": 1.0}), "expected x0 = None, because its state is not accessible"),
        (
            lambda f: f.start(params={"plant.yaw_colomb": 1.0}),
            "unknown parameter.*did you mean 'plant.yaw_coulomb'",
        ),
        (lambda f: f.start().state, "state is not accessible"),
        (lambda f: f.start().set(state={"u": 1.0}), "state is not accessible"),
        (lambda f: f.start().set(params={"plant.yaw_coulomb": 1.0}), "set where a run starts"),
        (lambda f: f.start().step({"trhust": 1.0}, 0.1), "unknown input 'trhust'; did you mean 'thrust'"),
        (lambda f: f.start().step([np.inf, 0.0], 0.1), "input 'thrust' is inf"),
    ],
)
def test_wrong_use_is_one_line(fmu, work, line):
    with pytest.raises(InputError, match=line):
        work(fmu)
