"""Tests of the guard in tests/conftest.py that fails a test which leaks resources."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.leftovers import Grace

ROOT = Path(__file__).parents[1]

INNER = """
import os, socket, sys, threading
import pytest

kept = []

def test_tidy(tmp_path):
    with (tmp_path / "x").open("w"), socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        one.listen()

def test_a_first_use_of_libzmq():
    import zmq
    kept.append(zmq.Context.instance())
    kept[-1].socket(zmq.PUB).close()

def test_a_thread_of_a_log():
    threading.Thread(target=threading.Event().wait, args=(60,), name="talker log", daemon=True).start()

def test_a_port():
    kept.append(socket.create_server(("127.0.0.1", 0)))

def test_a_connection():
    with socket.create_server(("127.0.0.1", 0)) as server:
        kept.append(socket.create_connection(server.getsockname()))

def test_an_abstract_socket():
    kept.append(socket.socket(socket.AF_UNIX))
    kept[-1].bind("\\0left-%d" % os.getpid())

def test_a_socket_of_a_path(tmp_path):
    kept.append(socket.socket(socket.AF_UNIX))
    kept[-1].bind(str(tmp_path / "s"))

def test_a_file(tmp_path):
    kept.append((tmp_path / "x").open("w"))

@pytest.mark.parametrize("number", range(4))
def test_pipes(number):
    kept.append(os.pipe())

@pytest.mark.parametrize("number", range(12))
def test_events(number):
    kept.append(os.eventfd(0))

def test_tidy_again():
    pass
"""

pytestmark = pytest.mark.skipif(not sys.platform.startswith("linux"), reason="needs /proc/self/fd")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> str:
    """Return the output of pytest for the inner tests, run with this project's guard and configuration."""
    folder = tmp_path_factory.mktemp("inner")
    (folder / "test_inner.py").write_text(INNER, encoding="utf-8")
    guard = (ROOT / "tests" / "conftest.py").read_text("utf-8").replace("_GRACE_S = 20.0", "_GRACE_S = 0.2")
    (folder / "conftest.py").write_text(guard, encoding="utf-8")
    command = [sys.executable, "-m", "pytest", "-c", str(ROOT / "pyproject.toml"), "--rootdir", str(folder)]
    done = subprocess.run(
        [*command, "-W", "ignore", "-n0", "-rA", str(folder / "test_inner.py")],
        cwd=folder,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        timeout=140,
        check=False,
    )
    return done.stdout


@pytest.mark.parametrize(
    ("test", "words"),
    [
        ("test_a_thread_of_a_log", "leaked threads: ['talker log']"),
        ("test_a_port", "leaked descriptors: [\"listening socket ('127.0.0.1', "),
        ("test_a_connection", "leaked descriptors: [\"socket ('127.0.0.1', "),
        ("test_an_abstract_socket", "leaked descriptors: [\"socket b'\\\\x00left-"),
        ("test_a_socket_of_a_path", "leaked descriptors: [\"socket '/"),
        ("test_a_file", "/x']"),
        ("test_pipes[3]", "leaked descriptors: ['pipe:"),
        ("test_events[11]", "leaked descriptors: ['anon_inode:[eventfd]']"),
    ],
)
def test_leaked_resource_fails_the_test_that_created_the_resource(report: str, test: str, words: str) -> None:
    assert f"ERROR test_inner.py::{test} - " in report
    assert words in report


@pytest.mark.parametrize(
    "test", ["test_tidy", "test_a_first_use_of_libzmq", "test_pipes[0]", "test_tidy_again"]
)
def test_tests_without_leaks_and_resources_of_libraries_pass(report: str, test: str) -> None:
    assert f"PASSED test_inner.py::{test}\n" in report
    assert f"ERROR test_inner.py::{test} " not in report


def test_grace_period_is_short_after_the_first_leak_of_a_test_file() -> None:
    grace = Grace(20.0, 1.0)
    leaky, tidy = Path("test_leaky.py"), Path("test_tidy.py")
    assert grace.seconds(leaky) == 20.0
    grace.add_leak(leaky)
    assert (grace.seconds(leaky), grace.seconds(tidy)) == (1.0, 20.0)
