"""Tests of `nep param`."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from nep.masters.master import Master
from nep.patterns.parameters.node_parameters import parameters_topic
from tests.nep.cli.conftest import TypeIn
from tests.nep.cli.test_command import LONG_S, Running


@pytest.fixture
def run(type_in: TypeIn, monkeypatch: pytest.MonkeyPatch) -> TypeIn:
    """Function that runs `nep param` with the given arguments."""
    monkeypatch.setenv("COLUMNS", "120")
    return lambda *words: type_in("param", *words)


@pytest.fixture
def node(master: Master) -> Iterator[nep.Node]:
    with nep.node("robot") as made:
        made.parameters.declare("speed", 0.5, min=0, max=2, description="how fast, in m/s")
        made.parameters.declare("mode", "walk", choices=("walk", "run"))
        made.parameters.declare("serial", "7", read_only=True)
        yield made


def test_parameters_are_listed_read_and_set(node: nep.Node, run: TypeIn) -> None:
    told = run("list", "robot")
    assert told.returncode == 0
    for word in ("speed", "0.5", "float", "0 ≤ … ≤ 2", "how fast, in m/s", '["walk","run"]', "read-only"):
        assert word in told.stdout
    assert [each["name"] for each in json.loads(run("list", "robot", "--json").stdout)] == [
        "speed",
        "mode",
        "serial",
    ]
    assert run("set", "robot", "speed", "1.5").returncode == 0
    assert run("set", "robot", "mode", "run").returncode == 0
    assert (node.parameters["speed"], node.parameters["mode"]) == (1.5, "run")
    assert run("get", "robot", "speed").stdout == "1.5\n"
    assert run("get", node.id, "mode", "--json").stdout.strip() == '"run"'


def test_rejected_changes_and_unknown_names_are_reported(node: nep.Node, run: TypeIn) -> None:
    refused = run("set", "robot", "speed", "9")
    assert (refused.returncode, refused.stdout) == (1, "")
    assert "the parameter 'speed' can't be 9: the maximum is 2" in refused.stderr
    assert "unknown parameter 'spead'; did you mean 'speed'?" in run("get", "robot", "spead").stderr
    assert "no node is named 'robt'; did you mean 'robot'?" in run("list", "robt").stderr
    node.parameters.declare("word", "x")
    assert run("set", "robot", "word", "5").returncode == 0
    assert node.parameters["word"] == "5", "a text stays one"


def test_dump_and_load_round_trip(node: nep.Node, run: TypeIn, tmp_path: Path) -> None:
    file = tmp_path / "robot.json"
    assert run("dump", "robot", str(file)).returncode == 0
    assert json.loads(file.read_text()) == {"speed": 0.5, "mode": "walk", "serial": "7"}
    assert json.loads(run("dump", "robot").stdout) == json.loads(file.read_text())
    assert os.listdir(tmp_path) == ["robot.json"]  # noqa: PTH208 - names
    node.parameters.set_all({"speed": 2, "mode": "run"})
    assert run("load", "robot", str(file)).returncode == 0
    assert (node.parameters["speed"], node.parameters["mode"]) == (0.5, "walk")
    file.write_text('{"speed": 1, "mode": "fly"}')
    refused = run("load", "robot", str(file))
    assert "the parameter 'mode' can't be 'fly': use 'walk' or 'run'" in refused.stderr
    assert node.parameters["speed"] == 0.5
    for text in ("[1]", "{no json"):
        file.write_text(text)
        assert run("load", "robot", str(file)).returncode == 1
    assert run("dump", "robot", str(tmp_path / "no" / "folder")).returncode == 1


def test_watch_shows_current_values_and_each_change_once(node: nep.Node) -> None:
    watching = Running("param", "watch", "robot")
    try:
        lines = iter(watching.process.stdout.readline, "")
        assert [next(lines) for _each in range(3)] == ["speed: 0.5\n", 'mode: "walk"\n', 'serial: "7"\n']
        node.parameters["speed"] = 0.5  # unchanged value
        with nep.node("stranger") as stranger, stranger.new_pub(parameters_topic(node.id)) as loud:
            loud.publish("no state")
            loud.publish({"parameters": 1})
            node.parameters["mode"] = "run"
            assert next(lines) == 'mode: "run"\n'
        node.parameters.declare("later", [1])
        assert next(lines) == "later: [1]\n"
        assert watching.interrupt()[0] == 130
    finally:
        watching.close()


def test_watch_of_one_parameter_ends_with_its_node_or_at_the_timeout(node: nep.Node, run: TypeIn) -> None:
    assert (
        run("watch", "robot", "mode", "--json", "--count", "1").stdout == '{"name":"mode","value":"walk"}\n'
    )
    assert "unknown parameter 'mod'; did you mean 'mode'?" in run("watch", "robot", "mod").stderr
    late = run("watch", "robot", "mode", "--timeout", "5")
    assert (late.returncode, late.stdout) == (1, 'mode: "walk"\n')
    assert "5 s" in late.stderr
    watching = Running("param", "watch", "robot", "speed")
    try:
        assert watching.process.stdout.readline() == "speed: 0.5\n"
        node.close()
        assert "the node has left the network; run the command again" in watching.wait_says("left")
        assert watching.process.wait(LONG_S) == 1
    finally:
        watching.close()
