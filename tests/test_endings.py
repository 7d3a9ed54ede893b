"""Every command ends kindly: whoever stops it, wherever its output goes, whatever a user's script does."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pytest

from hovercontrol.base import endings, folders
from hovercontrol.base.errors import InputError

RUN = [sys.executable, "-m", "hovercontrol.app.cli"]
STOPPED = "hovercontrol: stopped; nothing was written\n"


def raised(error):
    def command():
        raise error

    return command


@pytest.fixture(autouse=True)
def _signals_as_before(monkeypatch):
    before = {number: signal.getsignal(number) for number in endings.STOPS}
    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.mark.parametrize(
    ("command", "status", "said"),
    [
        (lambda: None, 0, ""),
        (lambda: 1, 1, ""),
        (raised(InputError("a\nb")), 2, "hovercontrol: a b\n"),
        (raised(OSError(28, "No space left", "x.csv")), 2, "hovercontrol: x.csv: No space left\n"),
        (raised(BrokenPipeError()), 0, ""),
        (raised(SystemExit(1)), 0, ""),
        (raised(MemoryError()), 2, "hovercontrol: not enough memory\n"),
        (raised(KeyboardInterrupt()), 130, STOPPED),
    ],
)  # fmt: skip
def test_every_end_has_its_status_and_one_line(command, status, said, capsys):
    assert endings.run(command) == status
    assert capsys.readouterr() == ("", said)


def test_a_fault_of_the_package_is_one_line_and_a_file_to_send(capsys, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(sys, "argv", ["hovercontrol", "check", "my run.csv"])
    assert endings.run(raised(KeyError("x" * 5000))) == 3
    said = capsys.readouterr().err
    (file,) = tmp_path.iterdir()
    assert said.startswith("hovercontrol: unexpected KeyError: 'xxx") and said.count("\n") == 1
    assert said.endswith(f"; please report this and send {file}\n")
    text = file.read_text()
    assert "command: hovercontrol check 'my run.csv'" in text and f"numpy {np.__version__}" in text
    assert "raise error" in text and __file__ in text  # where it came from
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))
    assert endings.run(raised(KeyError("x"))) == 3
    assert capsys.readouterr().err == "hovercontrol: unexpected KeyError: 'x'; please report this\n"


def test_a_wrong_argument_of_the_packages_own_call_is_a_fault_of_the_package(call, tmp_path, monkeypatch):
    """A gate told it as the user's once: 'Log.__getitem__: name: expected a text, found 0'."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr("hovercontrol.identification.engine.measure.POSE", (0,))
    done = call("identify", "--sample", "--out", str(tmp_path / "out"))
    assert done.returncode == 3
    assert "unexpected TypeError: Log.has: names: expected a text, found 0; please report" in done.stderr
    assert [f.suffix for f in tmp_path.iterdir()] == [".txt"]


def test_a_wrong_argument_in_a_model_file_of_the_users_is_his(call, tmp_path):
    (tmp_path / "m.py").write_text("import hovercontrol as hc\nMODEL = hc.vehicle(3)\n")
    done = call("identify", "--sample", "--model", "m.py:MODEL", cwd=tmp_path)
    assert done.returncode == 2
    assert "m.py, line 2: InputError: vehicle: name: expected a text, found 3" in done.stderr


def test_who_is_stopped_after_the_results_stand_says_so(tmp_path, capsys):
    def command():
        folders.write_folder(tmp_path / "out", lambda folder: (folder / "a.csv").write_text("1"))
        raise KeyboardInterrupt

    assert endings.run(command) == 130
    assert capsys.readouterr().err == f"hovercontrol: stopped; {tmp_path}/out was written before\n"


def test_a_stop_that_machine_code_turns_into_an_error_is_a_stop(capsys):
    def command():
        try:
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5)
        except KeyboardInterrupt:
            raise ValueError("Invalid affine transformation matrix") from None  # as a drawing library does

    assert endings.run(command) == 143
    assert capsys.readouterr().err == STOPPED
    assert endings.run(raised(ValueError("x"))) == 3, "it is no matter of the next command"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_with_one_line_and_nothing_of_the_folder(tmp_path, number, capsys):
    def write(folder):
        (folder / "half.csv").write_text("1,")
        os.kill(os.getpid(), number)
        time.sleep(5)

    status = endings.run(lambda: folders.write_folder(tmp_path / "out", write))
    assert (status, capsys.readouterr().err) == (endings.STOPS[number], STOPPED)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_in_the_midst_of_work_is_one_line(call, tmp_path, number, monkeypatch):
    def work(*given):
        os.kill(os.getpid(), number)
        time.sleep(5)

    monkeypatch.setattr("hovercontrol.documents.scenarios.runner._run_continuous", work)
    done = call("simulate", "k06-turn", "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (endings.STOPS[number], "", STOPPED)
    assert list(tmp_path.iterdir()) == []


def test_an_interrupt_that_a_finaliser_swallows_comes_again(capsys):
    class Deaf:
        def __del__(self):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    def command():
        Deaf()
        time.sleep(5)

    assert endings.run(command) == 130
    assert capsys.readouterr().err == STOPPED


@pytest.mark.skipif(not os.path.exists("/proc/self/status"), reason="looks at Linux' list of processes")
@pytest.mark.parametrize("wait", [0.0, 0.5])
def test_ctrl_c_while_the_command_starts_and_works(tmp_path, wait):
    """From when Python itself, some 0.03 s, has started."""
    call = [*RUN, "simulate", "k06-turn", "--out", str(tmp_path / "out")]
    process = subprocess.Popen(call, stdout=-1, stderr=-1, text=True)
    while not catches(process.pid, signal.SIGTERM):
        time.sleep(0.001)
    time.sleep(wait)
    process.send_signal(signal.SIGINT)
    out, said = process.communicate(timeout=20)
    assert (process.returncode, out, said) == (130, "", STOPPED)
    assert list(tmp_path.iterdir()) == []


def catches(process, number):
    status = Path(f"/proc/{process}/status").read_text()
    return int(status.partition("SigCgt:")[2].split()[0], 16) >> (number - 1) & 1


def test_a_reader_who_leaves_is_no_finding():
    process = subprocess.Popen([*RUN, "simulate", "--list"], stdout=-1, stderr=-1, text=True)
    process.stdout.close()
    assert process.stderr.read() == ""
    assert process.wait(20) == 0


@pytest.mark.slow
@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs a device that is full")
def test_a_full_device_for_the_output_is_one_line():
    with open("/dev/full", "w") as full:
        done = subprocess.run([*RUN, "simulate", "--list"], stdout=full, stderr=-1, text=True, timeout=20)
    assert done.returncode == 2
    assert done.stderr == "hovercontrol: the output cannot be written: No space left on device\n"


@pytest.mark.slow
@pytest.mark.parametrize("stream", [1, 2])
def test_a_closed_output_is_no_fault(stream, tmp_path):
    words = f'exec "$0" -m hovercontrol simulate sample --out out {stream}>&-'
    done = subprocess.run(
        ["sh", "-c", words, sys.executable], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0 and "unexpected" not in done.stdout + done.stderr
    assert (tmp_path / "out" / "log.csv").exists()


def test_help_says_what_every_status_means(call):
    said = " ".join(call("--help").stdout.split())
    assert "130 stopped by Ctrl-C" in said and "1 done, with a negative finding" in said
