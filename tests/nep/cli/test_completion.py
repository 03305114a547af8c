"""Tests of shell completion: current names are offered quickly and errors are never printed."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import nep
from nep.cli.complete import _reachable_master
from tests.nep.programs import eventually

REPOSITORY = Path(__file__).resolve().parents[3]
NEP = """
import sys
from nep.cli import complete, main
complete._CONNECT_TIMEOUT_S = complete._REPLY_TIMEOUT_S = complete._MESSAGE_TIMEOUT_S = 30.0
sys.argv[0] = "nep"
main()
"""


def complete(shell: str, line: str) -> list[str]:
    """Return the completions that the shell receives for the last word of `line`."""
    words = {
        "bash": {"COMP_WORDS": line, "COMP_CWORD": str(len(line.split(" ")) - 1)},
        "zsh": {"_TYPER_COMPLETE_ARGS": line},
        "fish": {"_TYPER_COMPLETE_ARGS": line, "_TYPER_COMPLETE_FISH_ACTION": "get-args"},
    }[shell]
    done = subprocess.run(
        [sys.executable, "-c", NEP],
        env={**os.environ, "PYTHONPATH": str(REPOSITORY), "_NEP_COMPLETE": f"complete_{shell}", **words},
        capture_output=True,
        encoding="utf-8",
        timeout=60,
        check=False,
    )
    assert done.stderr == ""
    if shell == "zsh":
        return re.findall(r'"([^"]+)"', done.stdout)
    return [word.split("\t")[0] for word in done.stdout.split()]


@pytest.fixture
def completed(type_in, monkeypatch):
    """Function that returns bash's completions of a line without a new process."""
    for name in ("_CONNECT_TIMEOUT_S", "_REPLY_TIMEOUT_S", "_MESSAGE_TIMEOUT_S"):
        monkeypatch.setattr(f"nep.cli.complete.{name}", 30.0)

    def completions(line):
        monkeypatch.setattr(
            sys.modules["__main__"], "__package__", None
        )  # or the program is "python -m pytest"
        monkeypatch.setenv("_NEP_COMPLETE", "complete_bash")
        monkeypatch.setenv("COMP_WORDS", line)
        monkeypatch.setenv("COMP_CWORD", str(len(line.split(" ")) - 1))
        done = type_in()
        assert done.stderr == ""
        return done.stdout.split()

    return completions


@pytest.fixture
def robot(master):
    with nep.node("Pepper") as node:
        pubs = [node.new_pub("/odom", latched=True), node.new_pub("/odd"), node.new_pub("words", "string")]
        pubs[0].publish({"pose": {"x": 1, "y": 2}, "joints": [1, 2]})
        eventually(lambda: "/odd" in node.graph().topics)
        yield


@pytest.mark.parametrize("shell", ["bash", "fish"])
def test_topics_are_completed(robot, shell):
    assert complete(shell, "nep topic echo /o") == ["/odd", "/odom"]


def test_topics_are_completed_in_zsh(robot):
    assert complete("zsh", "nep topic hz /o") == ["/odd", "/odom"]


def test_topic_already_on_the_command_line_is_not_completed_again(robot, completed):
    assert completed("nep topic hz /odom /o") == ["/odd"]


def test_fields_of_the_topic_are_completed(robot, completed):
    assert completed("nep topic echo /odom po") == ["pose.x", "pose.y"]
    assert completed("nep topic echo /odom j") == ["joints[0]", "joints[1]"]


def test_topics_and_types_are_completed_for_info_and_find(robot, completed):
    assert completed("nep topic info /odo") == ["/odom"]
    assert completed("nep topic find s") == ["string"]


def test_node_names_and_log_levels_are_completed(robot, completed):
    assert completed("nep log --node P") == ["Pepper"]
    assert completed("nep log --level w") == ["warning"]


def test_completion_without_a_reachable_master_is_empty(monkeypatch, completed):
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")
    assert completed("nep topic echo /o") == []
    line = SimpleNamespace(params={}, find_root=lambda: SimpleNamespace(params={}))
    with pytest.raises(OSError, match=r"refused|timed out"):  # fails at once, without waiting for a master
        _reachable_master(line)
    for wrong in ("no address at all", "a..b:7780", f"{'x' * 70}.invalid"):
        monkeypatch.setenv("NEP_MASTER", wrong)
        assert completed("nep topic echo /o") == []


def test_second_topic_is_completed_and_queries_leave_no_alert(robot, master, completed):
    assert completed("nep topic echo /odom /o") == ["/odd"]
    assert completed("nep topic echo /odom po") == ["pose.x", "pose.y"]
    assert not master.view().alerts
