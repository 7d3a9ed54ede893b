"""Real time: the dead-man's switch, recordings that say exactly what was flown, slow machines."""

import time

import numpy as np
import pytest

from hovercontrol.app.cockpit.loop import Loop
from hovercontrol.app.cockpit.pacer import SILENCE, Pacer
from hovercontrol.app.cockpit.recorder import Recorder
from hovercontrol.base.errors import InputError
from hovercontrol.blocks.simulation.trajectory import simulate
from hovercontrol.craft.models.vehicles import vehicle
from hovercontrol.identification.identify import identify
from hovercontrol.logs import read_log


@pytest.fixture
def pacer():
    running = Pacer(Loop(vehicle("hoverdemon")))
    running.start()
    yield running
    running.stop()


def fly(pacer, seconds, *sticks):
    """Hold each stick for some simulated time, the browser answering as it should."""
    for stick in sticks:
        end = pacer.state["signals"]["time"] + seconds
        while pacer.state["signals"]["time"] < end:
            pacer.heard(stick)
            time.sleep(0.01)


def ended(pacer):
    """End the recording and return it."""
    pacer.record(False)
    (recording,) = pacer.finished()
    return recording


def wait(true, seconds=20.0):
    end = time.monotonic() + seconds
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


def test_time_goes_on_with_the_clock_on_the_wall(pacer):
    assert pacer.state["signals"]["time"] == 0 and pacer.state["paused"]
    begun = time.monotonic()
    pacer.pause(False)
    time.sleep(1.0)
    simulated, passed = pacer.state["signals"]["time"], time.monotonic() - begun
    assert simulated <= passed + 0.02
    pacer.pause(True)
    held = pacer.state["signals"]["time"]
    time.sleep(0.2)
    assert pacer.state["signals"]["time"] == held


def test_commands_go_to_zero_within_half_a_second_of_silence(pacer):
    pacer.pause(False)
    pacer.record(True)
    fly(pacer, 0.3, (1.0, 0.5))
    last = pacer.state["signals"]["time"]
    wait(lambda: pacer.state["note"])
    log = ended(pacer).log()
    pushed = log.time[log["thrust"] > 0]
    assert 0 < SILENCE <= 0.5
    assert pushed.max() - last < 0.5
    assert log["rudder"][log.time > pushed.max()].max() == 0
    assert "No word from the browser" in pacer.state["note"] and pacer.state["law"] == "manual"


def test_silence_is_counted_on_where_time_stood_still_meanwhile(pacer):
    """To stop time and let it go on, over and over, does not keep the thrust on."""
    pacer.pause(False)
    fly(pacer, 0.1, (1.0, 0.0))
    last = pacer.state["signals"]["time"]
    begun = time.monotonic()
    while not pacer.state["note"]:
        assert time.monotonic() - begun < 5.0
        pacer.pause(True)
        time.sleep(0.01)
        pacer.pause(False)
        time.sleep(0.1)
    assert pacer.state["signals"]["thrust"] == 0 and pacer.state["signals"]["time"] - last < 0.6


def test_commands_go_to_zero_at_once_when_the_browser_leaves_whatever_law_flies(pacer):
    pacer.pause(False)
    pacer.heard((0.0, 0.0))
    pacer.command(law="forward")
    pacer.left()
    assert pacer.state["law"] == "manual" and pacer.state["signals"]["thrust"] == 0
    pacer.left()  # nobody was there
    assert "left" in pacer.state["note"]


def test_a_recording_holds_exactly_what_was_flown(pacer, tmp_path):
    pacer.pause(False)
    fly(pacer, 0.1, (0.5, 0.0))
    pacer.record(True)
    fly(pacer, 0.4, (1.0, 0.3), (0.6, -0.8), (-0.4, 0.2))
    path = ended(pacer).save(tmp_path)
    log = read_log(path, inputs=["thrust", "rudder"])
    assert path.name == "pilot-001.csv" and np.diff(log.time) == pytest.approx(0.01, abs=1e-9)
    start = {name: log[name][0] for name in ("x", "y", "psi", "u", "v", "r")}
    commands = {name: log[name] for name in ("thrust", "rudder")}
    again = simulate(vehicle("hoverdemon").plant(), log.time, commands, start, rtol=1e-10, atol=1e-12)
    for k, name in enumerate(start):
        assert log[name] == pytest.approx(again.outputs[k], abs=1e-7), name


@pytest.mark.slow
def test_identify_finds_the_crafts_coefficients_in_a_recording(pacer, tmp_path):
    pacer.pause(False)
    pacer.record(True)
    fly(pacer, 0.6, (1.0, 0.3), (0.6, -0.8), (0.8, 0.5), (0.3, -0.5), (-0.6, 0.4))
    log = read_log(ended(pacer).save(tmp_path), inputs=["thrust", "rudder"])
    started = vehicle("hoverdemon").with_coefficients({"thrust": 0.2, "rudder_torque": 1.0})
    found = identify(started, [log])
    assert found["thrust"].value == pytest.approx(1 / 2.6, rel=1e-3)
    assert found["rudder_torque"].value == pytest.approx(0.32 / 0.096, rel=1e-3)


def test_reset_ends_a_recording_and_keeps_it(pacer):
    pacer.pause(False)
    pacer.record(True)
    fly(pacer, 0.2, (1.0, 0.0))
    pacer.reset()
    (recording,) = pacer.finished()
    assert recording.seconds > 0.1 and pacer.finished() == []
    assert pacer.state["recording"] is None


def test_nothing_recorded_is_said_in_one_line(tmp_path):
    with pytest.raises(InputError, match="nothing was recorded"):
        Recorder(["thrust"]).save(tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_recording_takes_no_name_that_something_has(tmp_path):
    """A link, a folder, and what another cockpit saves into the same folder just now."""
    recorder = Recorder([])
    for k in range(2):
        recorder.add({"time": 0.01 * k, **dict.fromkeys(("x", "y", "psi", "u", "v", "r"), 0.0)})
    (tmp_path / "pilot-001.csv").symlink_to("nowhere")
    (tmp_path / "pilot-002.csv").mkdir()
    assert [recorder.save(tmp_path).name for _ in range(2)] == ["pilot-003.csv", "pilot-004.csv"]
    assert (tmp_path / "pilot-001.csv").is_symlink()
    (tmp_path / "pilot-004.csv").write_text("the other's")

    def unseen(folder):
        return []

    with pytest.MonkeyPatch.context() as changed:
        changed.setattr("hovercontrol.app.cockpit.recorder.names_in", unseen)
        assert recorder.save(tmp_path).name == "pilot-005.csv"
    assert (tmp_path / "pilot-004.csv").read_text() == "the other's"
    assert len(list(tmp_path.iterdir())) == 5


class Slow(Loop):
    """A loop on a machine that takes twice as long as real time."""

    def advance(self, until):
        time.sleep(2 * (until - self.time))
        super().advance(until)


def test_a_machine_that_is_too_slow_is_told_so_and_time_never_runs_after():
    slow = Pacer(Slow(vehicle("hoverdemon")))
    slow.start()
    slow.pause(False)
    wait(lambda: slow.state["slow"])
    assert slow.state["factor"] < 0.6
    slow.stop()


class Broken(Loop):
    """A loop whose motion leaves the numbers."""

    def advance(self, until):
        self._state[3] = float("inf")
        super().advance(until)


def test_a_motion_that_is_no_number_stops_time_and_says_so():
    broken = Pacer(Broken(vehicle("hoverdemon")))
    broken.start()
    broken.pause(False)
    wait(lambda: broken.state["note"])
    assert broken.state["paused"] and "reset" in broken.state["note"]
    broken.reset()
    assert broken.state["note"] == ""
    broken.stop()
