"""Tests of Ctrl+C at any moment of a command: it exits without a traceback, with code 130."""

from __future__ import annotations

import ast
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

import nep
from nep import public
from nep.cli import interrupts

REPOSITORY = Path(__file__).resolve().parents[3]
LONG_S = 60
pytestmark = pytest.mark.skipif(
    sys.platform == "win32", reason="a program of Windows cannot be sent Ctrl+C alone"
)

AT = """
import os, runpy, signal, sys
left = int(sys.argv.pop(1))

def looking(event, _arguments):
    global left
    if event == "import" and is_ours():
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGINT)

def is_ours():  # before that line of `main` it is Python's time, not ours
    return hasattr(sys.modules.get("nep.cli.interrupts"), "raise_on_interrupt")

sys.addaudithook(looking)
sys.argv[0] = "nep"
try:
    from nep.cli import main
    main()
finally:
    os.write(1, f"left {left}".encode())
"""


def python(code, *words, **more):
    env = {**os.environ, "PYTHONPATH": str(REPOSITORY)}
    return subprocess.run(
        [sys.executable, "-c", code, *words],
        capture_output=True,
        env=env,
        timeout=LONG_S,
        check=False,
        **more,
    )


def imports_of(*words):
    """Return the number of imports during the start of a command."""
    done = python(AT, "1000000", *words)
    return 1_000_000 - int(done.stdout.rpartition(b"left ")[2])


@pytest.mark.parametrize("words", [("--version",), ("topic", "hz", "--help")])
def test_interrupt_during_startup_exits_with_130(words):
    many = imports_of(*words)
    assert many > 100, "it shows what happens while much is imported"
    for at in (1, 2, 5, many // 4, many // 2, 3 * many // 4, many):
        done = python(AT, str(at), *words)
        assert done.stderr == b"", at
        assert done.returncode == 130, at


def test_cli_package_import_loads_no_other_modules():
    loaded = "import sys; old = set(sys.modules); import nep.cli; print(*set(sys.modules) - old)"
    new = {name for name in python(loaded).stdout.decode().split() if not name.startswith("importlib")}
    assert new <= {"nep", "nep.cli", "__future__", "warnings"}


def test_interrupt_during_interpreter_shutdown_exits_with_130():
    done = python(
        "import atexit, os, signal, sys; from nep.cli import main\n"
        "def interrupt():\n"  # a Python function: 3.10 checks for signals only between bytecodes
        "    os.kill(os.getpid(), signal.SIGINT)\n"
        "    os.getpid()\n"
        "atexit.register(interrupt)\n"
        "sys.argv[1:] = ['--version']; main()"
    )
    assert (done.returncode, done.stderr) == (130, b"")
    assert done.stdout.decode().strip() == f"nep {nep.__version__}"


def test_second_interrupt_ends_a_command_during_cleanup():
    done = python(
        "import os, signal; from nep.cli.interrupts import raise_on_interrupt\n"
        "raise_on_interrupt()\n"
        "try: os.kill(os.getpid(), signal.SIGINT)\n"
        "except KeyboardInterrupt: print('bye', flush=True); os.kill(os.getpid(), signal.SIGINT)\n"
        "print('never')"
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, b"bye\n", b"")


@pytest.mark.parametrize("kept", ["SIG_IGN", "SIG_DFL"])
def test_inherited_signal_handling_is_preserved(kept):
    done = python(
        f"import os, signal; from nep.cli.interrupts import raise_on_interrupt, exit_on_interrupt\n"
        f"signal.signal(signal.SIGINT, signal.{kept})\n"
        f"raise_on_interrupt(); assert signal.getsignal(signal.SIGINT) is signal.{kept}\n"
        f"exit_on_interrupt(); assert signal.getsignal(signal.SIGINT) is signal.{kept}\n"
    )
    assert done.returncode == 0, done.stderr


def test_every_termination_signal_is_handled_once_and_nohup_is_respected():
    done = python(
        "import os, signal\n"
        "from nep.cli.interrupts import call_on_signal, exit_on_termination\n"
        "for name in ('SIGINT', 'SIGTERM', 'SIGHUP'):\n"
        "    seen = []\n"
        "    exit_on_termination(7)\n"
        "    call_on_signal(lambda: seen.append(name))\n"
        "    os.kill(os.getpid(), getattr(signal, name))\n"
        "    assert seen == [name]\n"
        "    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL\n"
        "signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "exit_on_termination(7)\n"
        "assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN\n"
        "try: os.kill(os.getpid(), signal.SIGTERM)\n"
        "finally: print('bye', flush=True)\n"
    )
    assert (done.returncode, done.stdout, done.stderr) == (7, b"bye\n", b"")


# ---- the package, imported before Ctrl+C is handled


def test_lazy_exports_match_those_seen_by_type_checkers():
    tree = ast.parse(Path(nep.__file__).read_text(encoding="utf-8"))
    seen = {
        (each.name, statement.module)
        for statement in ast.walk(tree)
        if isinstance(statement, ast.ImportFrom)
        for each in statement.names
    }
    assert seen == {
        ("*", "nep.public"), ("__version__", "nep.version"), ("geometry", "nep"), ("sensor", "nep"),
    }  # fmt: skip
    names = {name for name in vars(public) if not name.startswith("_")}
    assert names | {"__version__"} == set(nep.__all__)
    assert "Node" in names
    assert all(getattr(nep, name) is getattr(public, name) for name in names)
    assert nep.node is nep.Node
    assert nep.master is nep.Master


def test_public_names_and_the_errors_module_are_imported_lazily():
    done = python(
        "import nep\n"
        "assert 'errors' not in vars(nep)\n"
        "assert issubclass(nep.errors.ClosedError, nep.NepError)\n"
        "assert not hasattr(nep, 'frobnicate') and not hasattr(nep, '__wrapped__')\n"
        "from nep import *\n"
        "assert Publisher is nep.Publisher and node is Node\n"
        "assert {'Node', 'errors', '__version__'} <= set(dir(nep))\n"
    )
    assert done.returncode == 0, done.stderr


def test_public_names_are_available_during_interpreter_shutdown():
    done = python(
        "import sys, nep; node = nep.Node\n"
        "class Last:\n"
        "    def __del__(self, nep=nep): print(nep.ClosedError.__name__, flush=True)\n"
        "sys.modules['last'] = Last()\n"
    )
    assert (done.stdout, done.stderr) == (b"ClosedError\n", b"")


def test_missing_package_raises_module_not_found_error():
    done = python("import sys; sys.modules['zmq'] = None\nimport nep\nnep.node")
    assert b"ModuleNotFoundError: " in done.stderr


def test_interrupt_during_a_finalizer_is_raised_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Python prints an exception raised in a finalizer and continues, so the command would not end."""

    class Interrupted:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    def work() -> None:
        made = Interrupted()
        del made
        threading.Event().wait(60.0)

    monkeypatch.setattr(interrupts, "_exit_after_grace", lambda: None)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        interrupts.raise_on_interrupt()
        with pytest.raises(KeyboardInterrupt):
            work()
    finally:
        signal.signal(signal.SIGINT, before)
