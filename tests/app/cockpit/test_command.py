"""``hovercontrol cockpit`` as a new user meets it."""

import re
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request

import pytest

from hovercontrol.app.cli import main

HOVERCONTROL = [sys.executable, "-m", "hovercontrol.app.cli", "cockpit", "--no-open"]


@pytest.fixture
def refused(monkeypatch, capsys, tmp_path):
    def command(*arguments):
        monkeypatch.chdir(tmp_path)
        monkeypatch.setattr(sys, "argv", ["hovercontrol", "cockpit", "--no-open", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        said = capsys.readouterr()
        assert ended.value.code == 2 and said.out == ""
        assert said.err.startswith("hovercontrol: ") and said.err.count("\n") == 1
        return said.err

    return command


def started(*arguments, folder):
    return subprocess.Popen([*HOVERCONTROL, *arguments], stdout=subprocess.PIPE, text=True, cwd=folder)


def test_help_has_an_example(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["hovercontrol", "cockpit", "--help"])
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 0 and "Example: hovercontrol cockpit" in capsys.readouterr().out


def test_wrong_input_is_refused_in_one_line(refused, tmp_path):
    (tmp_path / "file").write_text("no folder")
    (tmp_path / "velocities.csv").write_text("time,u,v,r\n0,1,0,0\n0.1,1,0,0\n")
    for arguments, text in [
        (["--vehicle", "hoverdemo"], "did you mean 'hoverdemon'"),
        (["--model", "none.toml"], "none.toml"),
        (["--model", "a.toml", "--vehicle", "hoverdemon"], "exclude each other"),
        (["--replay", "none.csv"], "there is no such file"),
        (["--replay", "velocities.csv"], "expected the pose x, y, psi"),
        (["--out", "file/flights"], "not a folder"),
        (["--loop", "reel", "--port", "0"], "did you mean 'real'"),
        (["--vehicle", "four_fan", "--loop", "real", "--port", "0"], "thrust is in newton"),
        (["--port", "99999"], "65535"),
        (["--port", "0", "--host", "no.such.host.invalid"], "is not an address of this machine"),
    ]:
        assert text in refused(*arguments), arguments


def test_without_the_web_server_it_says_what_to_install(refused, monkeypatch):
    for name in [n for n in sys.modules if n.startswith("hovercontrol.app.cockpit.")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "aiohttp", None)
    assert "pip install '.[cockpit]'" in refused()


def test_a_port_in_use_is_said_with_a_way_out(refused):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        line = refused("--port", str(port))
    assert f"port {port} is in use" in line and "--port 0" in line


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no such signals there")
def test_it_tells_its_address_serves_there_and_ends_when_told(tmp_path):
    own = started("--port", "0", folder=tmp_path)
    try:
        line = own.stdout.readline()
        address = re.search(r"http://127\.0\.0\.1:\d+/", line)[0]
        with urllib.request.urlopen(address, timeout=90) as page:
            assert b"<canvas" in page.read()
        own.send_signal(signal.SIGINT)
        rest, _ = own.communicate(timeout=90)
    finally:
        own.kill()
        own.wait()
    assert own.returncode == 0 and "nothing was recorded" in rest
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_beyond_this_machine_the_printed_address_has_a_token(tmp_path):
    own = started("--port", "0", "--host", "0.0.0.0", folder=tmp_path)
    try:
        line = own.stdout.readline()
        port, token = re.search(r"http://[^:]+:(\d+)/\?token=(\S+)", line).groups()
        assert len(token) >= 16
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/?token={token}", timeout=90) as page:
            assert page.status == 200
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(f"http://127.0.0.1:{port}/", timeout=90)
    finally:
        own.kill()
        own.wait()
