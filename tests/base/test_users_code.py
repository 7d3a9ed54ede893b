"""A model file that breaks what it can is refused in one line that names it; no command hangs by it."""

import json
import os
import subprocess
import sys
import time

import pytest

RUN = [sys.executable, "-m", "hovercontrol"]
MODEL = "\nimport hovercontrol as hc\nMODEL = hc.vehicle('c17_simulation')\n"

#: What a file does, and what is said of it.
REFUSED = {
    "exit": ("import sys\nsys.exit(0)", "line 2: SystemExit: 0"),
    "exit by name": ("raise SystemExit('enough')", "line 1: SystemExit: enough"),
    "interrupt": ("raise KeyboardInterrupt", "line 1: KeyboardInterrupt: no message"),
    "own interrupt": (
        "class Mine(KeyboardInterrupt): pass\nraise Mine('now')",
        "line 2: Mine: now",
    ),
    "base": ("class Mine(BaseException): pass\nraise Mine", "line 2: Mine: no message"),
    "str": (
        "class Mute(Exception):\n    def __str__(self): raise ValueError('no')\nraise Mute",
        "line 3: Mute: its text cannot be shown",
    ),
    "str exits": (
        "class Mute(Exception):\n    def __str__(self): raise SystemExit\nraise Mute",
        "line 3: Mute: its text cannot be shown",
    ),
    "recursion": (
        "class Deep:\n    def __repr__(self): return repr(self)\nrepr(Deep())",
        "line 2: RecursionError: maximum recursion depth exceeded",
    ),
    "own recursion": ("def f(): f()\nf()", "line 1: RecursionError"),
    "path": ("import sys\nsys.path.clear()", "removes entries of sys.path"),
    "path bound": ("import sys\nsys.path = []", "removes entries of sys.path"),
    "path is none": ("import sys\nsys.path = None", "removes entries of sys.path"),
    "modules": ("import sys\nsys.modules.clear()\nimport hovercontrol", "line 3: "),
    "class": (
        "class Odd:\n    @property\n    def __class__(self): raise OSError('odd')\nodd = Odd()",
        "line 3: OSError: odd",
    ),
    "attribute": ("def __getattr__(name): raise OSError(name)", "line 1: OSError: M"),
}

#: What a file may break without harm.
MENDED = {
    "stdout": "import sys\nsys.stdout = None",
    "stdout replaced": "import io, sys\nsys.stdout = io.StringIO()",
    "imports": "import sys\nsys.modules['numpy'] = None\nsys.meta_path.clear()",
}

#: The same of what belongs to the whole process.
MENDED_APART = {
    "built-in": "import builtins\nbuiltins.print = builtins.open = builtins.zip = None",
    "settings": "import os, signal, sys, warnings\nimport numpy as np\nos.chdir('/')\nos.umask(0o777)\n"
    "warnings.simplefilter('error')\nnp.seterr(all='raise')\nsignal.signal(signal.SIGINT, signal.SIG_IGN)\n"
    "sys.setrecursionlimit(80)",
    "stdout closed": "import sys\nsys.stdout.close()\nsys.stderr.close()",
    "stdout really closed": "import sys\nsys.__stdout__.close()",
    "descriptor": "import os\nos.close(1)\nos.close(2)",
    "null": "import os\nos.dup2(os.open(os.devnull, os.O_WRONLY), 1)",
    "threads": "import threading, time\nthreading.Thread(target=time.sleep, args=(0.01,)).start()\n"
    "threading.Thread(target=time.sleep, args=(99,), daemon=True).start()\n"
    "from concurrent.futures import ThreadPoolExecutor\nThreadPoolExecutor(2).submit(print, end='')",
}  # fmt: skip


def written(folder, code):
    (folder / "model.py").write_text(f"{code}\n{MODEL}")
    return folder


@pytest.mark.parametrize("name", REFUSED)
def test_what_a_file_does_is_refused_in_one_line_that_names_it(call, tmp_path, name):
    code, said = REFUSED[name]
    before = list(sys.path)
    done = call("simulate", "model.py:M" if name == "attribute" else "model.py", cwd=written(tmp_path, code))
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    assert done.stderr.startswith("hovercontrol: model.py") and said in done.stderr
    assert sys.path == before and [p.name for p in tmp_path.iterdir() if p.suffix] == ["model.py"]


EXPORT = ["export", "model.py", "-o", "plant.fmu", "--platforms", "x86_64-linux"]


def assert_exported(folder, done):
    assert done.returncode == 0 and done.stdout.startswith("wrote plant.fmu: FMI 3.0"), done.stderr
    assert (folder / "plant.fmu").stat().st_mode & 0o777 == 0o666 & ~umask()


@pytest.mark.parametrize("name", MENDED)
def test_what_a_file_breaks_is_mended(call, tmp_path, monkeypatch, name):
    finders, numpy, out = list(sys.meta_path), sys.modules["numpy"], sys.stdout
    monkeypatch.setattr(sys, "meta_path", list(finders))  # for later tests, should this one fail
    monkeypatch.setitem(sys.modules, "numpy", numpy)
    monkeypatch.setattr(sys, "stdout", out)
    assert_exported(tmp_path, call(*EXPORT, cwd=written(tmp_path, MENDED[name])))
    assert (sys.meta_path, sys.modules["numpy"], sys.stdout) == (finders, numpy, out)


@pytest.mark.slow
@pytest.mark.parametrize("name", MENDED_APART)
def test_what_a_file_breaks_of_its_process_is_mended(tmp_path, name):
    assert_exported(tmp_path, apart(tmp_path, MENDED_APART[name]))


def apart(folder, code, words=EXPORT):
    """Run a command on a file in a process of its own."""
    words = [*RUN, *words]
    return subprocess.run(words, cwd=written(folder, code), capture_output=True, text=True, timeout=60)


def umask():
    mask = os.umask(0)
    os.umask(mask)
    return mask


LEFT = {
    "thread": "import threading, time\nthreading.Thread(target=time.sleep, args=(99,), name='mine').start()",
    "process": "import multiprocessing, time\n"
    "multiprocessing.get_context('fork').Process(target=time.sleep, args=(99,), name='mine').start()",
}


@pytest.mark.slow("process")
@pytest.mark.parametrize("kind", LEFT)
def test_what_is_left_running_is_refused_and_the_command_ends(tmp_path, kind):
    begun = time.monotonic()
    done = apart(tmp_path, LEFT[kind], ["simulate", "model.py"])
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr.startswith(f"hovercontrol: model.py: leaves the {kind} 'mine' running")
    assert done.stderr.count("\n") == 1 and time.monotonic() - begun < 30


@pytest.mark.slow
@pytest.mark.parametrize(
    "code",
    [
        "import atexit, time\natexit.register(time.sleep, 99)",
        "from concurrent.futures import ThreadPoolExecutor\nimport time\n"
        "ThreadPoolExecutor(1).submit(time.sleep, 99)",
    ],
)
def test_what_delays_the_end_of_python_is_not_waited_for(tmp_path, code):
    assert_exported(tmp_path, apart(tmp_path, code))


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.slow("SystemExit")
@pytest.mark.parametrize("more", ["\nif not pid: raise SystemExit", "\nif not pid: 1 / 0"])
def test_a_fork_runs_the_command_once(tmp_path, more):
    code = f"import os\npid = os.fork(){more}\nif pid: os.waitpid(pid, 0)"
    done = apart(tmp_path, code)
    assert done.returncode == 0 and done.stdout.count("wrote") == 1
    assert "ZeroDivisionError" not in done.stderr


EFFECT = """
import sys, hovercontrol as hc

class Own(hc.Effect):
    "An effect that fails when it is asked for."
    name = "own_in_users_code"
    value = hc.Coefficient("1")

    def terms(self, c, s):
        {does}

MODEL = hc.vehicle("c17_simulation").with_effects([Own(0.2)])
"""


@pytest.fixture
def forget():
    from hovercontrol.craft.effects import Effect

    yield
    Effect.known.pop("own_in_users_code", None)


@pytest.mark.parametrize(
    ("does", "said"),
    [
        ("sys.exit(0)", "SystemExit: 0"),
        ("raise KeyboardInterrupt", "KeyboardInterrupt"),
        ("return 1 / 0", "ZeroDivisionError: division by zero"),
        ("open('none.txt')", "FileNotFoundError: "),
        ("return self.terms(c, s)", "RecursionError: "),
        ("raise type('Mine', (BaseException,), {'__str__': lambda s: 1 / 0})", "Mine: its text cannot"),
    ],
)
def test_what_fails_later_names_the_file_too(call, tmp_path, does, said, forget):
    (tmp_path / "model.py").write_text(EFFECT.format(does=does))
    done = call("simulate", "model.py", "--out", "out", cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, ""), done.stderr
    assert "model.py, line 10: " in done.stderr and said in done.stderr and done.stderr.count("\n") == 1
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_file_called_as_something_installed_does_not_hide_it(tmp_path):
    (tmp_path / "control.py").write_text("import beside" + MODEL + "print(beside.VALUE)\n")
    (tmp_path / "beside.py").write_text("VALUE = 42\n")
    words = ["export", str(tmp_path / "control.py"), "-o", "plant.fmu", "--platforms", "x86_64-linux"]
    code = "from hovercontrol.app.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        cwd=tmp_path.parent, capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0 and done.stdout.startswith("42\n"), done.stderr
    (tmp_path.parent / "plant.fmu").unlink()


# ---- one JSON value ----------------------------------------------------------------------------------------

PRINTS = """
import atexit, os, subprocess, sys
print("by print")
sys.stdout.write("by write\\n")
os.write(1, b"by descriptor\\n")
subprocess.run([sys.executable, "-c", "print('by a process')"])
print("at the original", file=sys.__stdout__)
atexit.register(print, "at the end")
for _ in range(1000): print("x" * 100)
"""


@pytest.mark.slow
def test_what_a_file_prints_is_not_in_the_json_value(tmp_path):
    done = apart(tmp_path, PRINTS, ["simulate", "model.py", "--duration", "1", "--json", "--out", "out"])
    assert done.returncode == 0 and json.loads(done.stdout)["scenario"] == "c17_simulation"
    for said in ("by print", "by write", "by descriptor", "by a process", "at the original", "at the end"):
        assert said in done.stderr


def test_without_json_it_is_printed(call, tmp_path):
    done = call("export", "model.py", "-o", "a.fmu", cwd=written(tmp_path, "print('hello')"))
    assert done.returncode == 0 and done.stdout.startswith("hello\nwrote")


def test_standard_output_is_as_before_after_a_command(call, tmp_path):
    before = sys.stdout
    done = call("simulate", "model.py", "--json", cwd=written(tmp_path, "print('hello')\nimport nothing"))
    assert (done.returncode, done.stdout) == (2, "") and sys.stdout is before
