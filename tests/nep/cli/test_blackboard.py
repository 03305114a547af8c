"""Tests of the command `nep blackboard`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from tests.nep.cli.conftest import TypeIn

REPOSITORY = Path(__file__).resolve().parents[3]
ENVIRONMENT = {"PYTHONPATH": str(REPOSITORY), "COLUMNS": "160"}


@pytest.fixture
def run(type_in: TypeIn, monkeypatch: pytest.MonkeyPatch) -> TypeIn:
    """Function that runs `nep blackboard` with the given arguments."""
    monkeypatch.setenv("COLUMNS", "160")
    return lambda *words: type_in("blackboard", *words)


@contextmanager
def started(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    """Start `nep blackboard` as a process and wait until it runs."""
    process = subprocess.Popen(
        [sys.executable, "-m", "nep", "blackboard", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        env={**os.environ, **ENVIRONMENT},
    )
    try:
        assert process.stderr is not None
        assert "running blackboard" in process.stderr.readline()
        yield process
    finally:
        if process.poll() is None:
            process.kill()
        process.communicate()


@pytest.mark.usefixtures("patient")
def test_blackboard_command_watches_topics_and_shows_values(master: Master, run: TypeIn) -> None:
    with started("/blackboard", "human=/perception/humans", "/other/*") as process, nep.node("robot") as node:
        board = node.new_client("blackboard/get", timeout_s=30.0)
        node.new_pub("/blackboard").publish({"primitive": "touched", "input": {"head": 1}, "robot": "Pepper"})
        node.new_pub("/perception/humans").publish({"1": {"name": "Ada\x1b[2J"}})
        node.new_pub("/other/one").publish(7)
        sub = node.new_sub("/blackboard/changes")
        keys = ["human.1.name", "other.one", "touched.head"]
        while node.new_client("blackboard/keys", timeout_s=30.0).call({})["keys"] != keys:  # type: ignore[index]
            assert sub.listen(timeout_s=30.0)[0]
        shown = run("show")
        assert shown.returncode == 0
        head, _line, *rows = shown.stdout.splitlines()
        assert head.split() == ["key", "value", "age", "based", "on", "from", "robot"]
        assert [row.split()[0] for row in rows if row] == keys
        assert rows[2].split()[-3:] == ["stamp", "/blackboard", "Pepper"]
        assert "\x1b" not in shown.stdout
        (entry,) = json.loads(run("show", "touched.*", "--json").stdout)
        assert (entry["key"], entry["value"], entry["age_by"]) == ("touched.head", 1, "stamp")
        none = run("show", "nothing.*")
        assert (none.returncode, none.stdout) == (0, "")
        assert "no matching values" in none.stderr
        refused = run("show", "")
        assert refused.returncode == 1
        assert "'' isn't a valid key" in refused.stderr
        assert board.call({"key": "touched.head"})["value"] == 1  # type: ignore[index]
        if sys.platform != "win32":
            process.send_signal(signal.SIGTERM)
            assert process.wait(60.0) == 0


def test_name_and_lifetime_options_are_applied(master: Master, run: TypeIn) -> None:
    with started("--name", "home", "--lives", "0.05", "--max-keys", "5"), nep.node("robot") as node:
        told = node.new_sub("/home/changes")
        pub = node.new_pub("/blackboard")
        causes: list[object] = []
        while len(causes) < 2:
            if not causes:  # on a busy computer, a value may arrive after its lifetime
                pub.publish({"primitive": "word", "input": {"hello": 1}})
            ok, change = told.listen(timeout_s=1.0)
            causes += [change["cause"]] if ok else []  # type: ignore[index]
        assert causes == ["new", "expired"]
        assert json.loads(run("show", "--name", "home", "--json").stdout) == []


def test_invalid_arguments_and_unavailable_blackboards_are_reported(master: Master, run: TypeIn) -> None:
    nobody = run("show", "--name", "nobody", "--timeout", "0.2")
    assert (nobody.returncode, nobody.stdout) == (1, "")
    assert "no blackboard 'nobody' is running; start one with 'nep blackboard'" in nobody.stderr
    for words in (("a b",), ("run", ""), ("=/x",), ("--name", "")):
        done = run(*words)
        assert done.returncode == 1, words
        assert done.stderr.startswith("nep: "), words
        assert "Traceback" not in done.stderr
    for words in (
        ("--lives", "-1"),
        ("--lives", "0"),
        ("--lives", "nan"),
        ("--max-keys", "0"),
        ("--nonsense",),
    ):
        assert run(*words).returncode == 2, words
    with nep.node("robot") as node:
        node.new_server("odd/get", lambda _request: {"entries": [5]}, threads=1)
        odd = run("show", "--name", "odd")
        assert odd.returncode == 1
        assert "the service that replied isn't a blackboard" in odd.stderr


def test_missing_master_is_reported(run: TypeIn) -> None:
    done = run("--master", "127.0.0.1:1")
    assert done.returncode == 1
    assert "no master replied at '127.0.0.1:1'" in done.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="a program of Windows cannot be sent Ctrl+C alone")
def test_ctrl_c_exits_with_130(master: Master) -> None:
    with started() as process:
        process.send_signal(signal.SIGINT)
        assert process.wait(60.0) == 130
        assert process.stderr is not None
        assert "Traceback" not in process.stderr.read()
