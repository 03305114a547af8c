"""Tests of `--backend`: topic and node commands over a back end without a master."""

from __future__ import annotations

import json
import threading

import pytest

import nep
from nep.nodes.publisher import Publisher
from tests.nep.meeting import place_for


@pytest.fixture
def there(monkeypatch):
    """Command-line options of a network over the memory back end in which a node publishes /odom."""
    monkeypatch.setenv("NEP_MASTER", "127.0.0.1:1")  # an address of another back end is ignored
    place, ended = place_for("memory", ""), threading.Event()

    def publish(publisher: Publisher) -> None:
        number = 0
        while not ended.wait(0.005):
            number += 1
            publisher.publish({"x": number})

    with nep.node("robot", "memory", master=place) as node:
        thread = threading.Thread(target=publish, args=(node.new_pub("/odom", "robot/odometry"),))
        thread.start()
        yield "--backend", "memory", "--master", place
        ended.set()
        thread.join()


def test_topics_and_nodes_of_a_back_end_are_listed_without_the_command_itself(there, type_in):
    assert [each["name"] for each in json.loads(type_in("topic", "list", "--json", *there)[1])] == ["/odom"]
    assert [each["name"] for each in json.loads(type_in("node", "list", "--json", *there)[1])] == ["robot"]
    assert type_in("topic", "type", "/odom", *there)[:2] == (0, "robot/odometry\n")
    assert "publishes" in type_in("topic", "info", "/odom", *there)[1]
    assert type_in("topic", "find", "robot/odometry", *there)[1] == "/odom\n"


def test_messages_of_a_back_end_are_printed_filtered_and_measured(there, type_in):
    code, out, _err = type_in("topic", "echo", "/odom", "x", "--filter", "x > 5", "-n", "2", "--json", *there)
    first, second = (json.loads(line)["fields"]["x"] for line in out.splitlines())
    assert (code, second) == (0, first + 1)
    assert first > 5
    code, out, _err = type_in("topic", "hz", "/odom", "-n", "1", "--json", *there)
    assert json.loads(out)["rate_hz"] > 0


def test_unknown_back_end_is_an_error(type_in):
    code, out, err = type_in("topic", "list", "--backend", "zenho")
    assert (code, out) == (1, "")
    assert "zenoh" in err


@pytest.mark.parametrize(
    "words",
    [
        ("topic", "list", "--backend", "\x1b[31m\nx"),
        ("topic", "pub", "t", "@\x1b[31m\nx", "--backend", "memory"),
        ("bridge", "\x1b[31m\nx"),
        ("watch", "\x1b[31m\nx"),
        ("play", "\x1b[31m\nx"),
        ("topic", "echo", "t", "--filter", "\x1b[31m\nx +"),
    ],
)
def test_names_in_errors_cannot_control_the_terminal_or_forge_a_line(words, type_in):
    code, out, err = type_in(*words)
    assert (code in {1, 2}, out) == (True, "")
    assert "\x1b" not in err
    assert "\nx" not in err
