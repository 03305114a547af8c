"""Tests of payloads in the output of commands: complete as JSON, abbreviated in a terminal.

No payload may end a command.
"""

from __future__ import annotations

import io
import json
import math
import re
import threading

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

import nep
from nep.cli.topics.echo import MessagePrinter, echo, show_record, topics_and_fields
from nep.cli.values import convert_ids_to_text, encode_json, format_payload
from nep.messages.message import Message
from nep.messages.packing import pack
from tests.nep.programs import eventually

DEEP = b"[" * 900 + b"]" * 900
ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=6) | st.binary(max_size=6),
    lambda inner: (
        st.lists(inner, max_size=4)
        | st.dictionaries(st.text(max_size=4) | st.integers() | st.binary(max_size=3), inner, max_size=3)
    ),
    max_leaves=12,
)


@given(ANYTHING)
def test_every_decoded_value_becomes_valid_json(value):
    json.loads(encode_json(value))
    assert "\n" not in encode_json(value).decode()
    assert format_payload(value, in_full=True) is not None
    assert format_payload(value, in_full=False, indent=True) is not None


@pytest.mark.parametrize(
    ("value", "shown"),
    [
        ([math.nan, math.inf, -math.inf, 1.5], "[nan,inf,-inf,1.5]"),
        (list(range(1000)), "[0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,… 980 more]"),
        ({"picture": "x" * 5000}, '{"picture":"' + "x" * 500 + '… (5000 characters)"}'),
        (b"\x00\xff", '"00ff"'),
        (2**70, f'"{2**70}"'),
        ({b"\x01": 1}, '{"01":1}'),
    ],
)
def test_value_is_presented_for_the_terminal(value, shown):
    assert format_payload(value, in_full=False) == shown


def test_many_fields_are_abbreviated_and_all_shown_on_request():
    many = {f"field{number}": number for number in range(10_000)}
    shown = format_payload(many, in_full=False)
    assert shown.endswith('"field99":99,"…":"9900 more"}')
    assert json.loads(format_payload(many, in_full=True)) == many


def test_control_characters_are_escaped_in_json():
    value = {"a\x9b": "\x7f\u202e\u2028"}
    data = encode_json(value)
    assert data.isascii()
    assert json.loads(data) == value


def test_ids_are_converted_to_strings_at_every_level():
    assert convert_ids_to_text({"id": 2**60, "publishers": ({"id": 7, "count": 7},), "name": "x"}) == {
        "id": str(2**60), "publishers": [{"id": "7", "count": 7}], "name": "x",
    }  # fmt: skip


@pytest.mark.parametrize(
    "message",
    [
        Message("t", DEEP, "json", "json"),
        Message("t", b'{"a": NaN, "b": 123456789012345678901234567890}', "json", "json"),
        Message("t", b'["\\ud800"]', "json", "json"),
        Message("t", b"\xff\xfe{", "json", "json"),
        Message("t", b"\xff\xfe", "string", "string"),
        Message("t", pack({1: b"\x00", b"k": [2**64 - 1]}), "msgpack", "msgpack"),
        Message("t", b"x", "image", "image", extension={"shape": ["\x1b[2J", 2], "encoding": "\x1b[2J" * 99}),
        Message("t", b"x", "none such", "json"),
        Message("t", b"1", "json", "json", stamp_ns=2**64 - 1, seq=2**64 - 1),
    ],
)
def test_hostile_message_does_not_end_a_command(message, capsys):
    show_record(message)
    MessagePrinter()(message)
    out = capsys.readouterr().out
    assert json.loads(out.splitlines()[0])["topic"] == "t"
    assert "\x1b" not in out


def test_multiline_text_cannot_forge_another_message(capsys):
    MessagePrinter()(Message("t", b"one\n12:00:00.000  #9  forged\x1b[2J", "string", "string"))
    lines = capsys.readouterr().out.splitlines()
    assert lines[1] == "    12:00:00.000  #9  forged\\x1b[2J"


class Terminal(io.StringIO):
    """Standard output that reports to be a terminal."""

    encoding = "utf-8"

    def isatty(self):
        return True


@pytest.mark.parametrize("more", [{}, {"NO_COLOR": "1"}, {"TERM": "dumb"}, {"COLUMNS": "20"}])
def test_terminal_output_is_truncated_unless_full_is_requested(monkeypatch, more):
    for name, value in {"TERM": "xterm", "COLUMNS": "100", **more}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.stdout", screen := Terminal())
    long = Message("t", orjson.dumps({"joints": list(range(5000)), "note": "\x1b[2J"}), "json", "json", seq=1)
    MessagePrinter()(long)
    short = screen.getvalue()
    assert "\x1b[2J" not in short
    assert "… 4980 more" in re.sub(r"\x1b\[[0-9;]*m", "", short)
    assert bool(re.search(r"\x1b\[(\d;)?3\dm", short)) == (not more.keys() & {"NO_COLOR", "TERM"})
    assert more.get("TERM") != "dumb" or "\x1b" not in short
    MessagePrinter(in_full=True)(long)
    assert "4999" in screen.getvalue()


@pytest.fixture
def robots(master):
    with nep.node("robots") as node:
        for name, value in (("/a", {"x": 1}), ("/b", {"x": 2}), ("battery", {"x": 3, "battery": 7})):
            node.new_pub(name, latched=True).publish(value)
        yield node, master.address


def test_two_topics_are_shown_with_their_names(robots, capsys):
    _, address = robots
    echo("/a", ["/b"], 2, 60.0, address)
    lines = sorted(line.split("  ", 1)[1] for line in capsys.readouterr().out.splitlines())
    assert lines == ['#1  /a  {"x":1}', '#1  /b  {"x":2}']
    echo("/a", ["/b", "x"], 2, 60.0, address, as_csv=True)
    head, *rows = capsys.readouterr().out.splitlines()
    assert head == "stamp_s,topic,x"
    assert sorted(row.split(",", 1)[1] for row in rows) == ["/a,1", "/b,2"]


def test_arguments_are_distinguished_as_topics_or_fields(robots, capsys):
    node, _ = robots
    graph = node.graph()
    assert topics_and_fields("/a", ["x", "/b", "joints[0]", "/later"], graph) == (
        ["/a", "/b", "/later"],
        ["x", "joints[0]"],
    )
    assert topics_and_fields("/a", ["battery"], graph) == (["/a", "battery"], [])
    assert "use .battery for a field" in capsys.readouterr().err
    assert topics_and_fields("/a", [".battery"], graph) == (["/a"], [".battery"])


def test_lost_messages_are_reported(master, capsys):
    with nep.node("talker") as node:
        pub = node.new_pub("t")
        running = threading.Thread(target=echo, args=("t", None, 2, 60.0, master.address))
        running.start()
        while not pub.subscribers:
            threading.Event().wait(0.01)
        pub.publish(1)
        transport = pub._transport
        for _ in range(3):
            transport.skip()
        pub.publish(2)
        running.join()
    assert "3 messages of 't' were lost" in capsys.readouterr().err


def test_removed_or_renamed_topic_is_reported(master, capsys):
    with nep.node("talker") as node:
        pub = node.new_pub("/odom", latched=True)
        pub.publish(1)
        node.new_pub("/odom2")
        running = threading.Thread(target=echo, args=("/odom", None, 2, 60.0, master.address))
        running.start()
        while not pub.subscribers:
            threading.Event().wait(0.01)
        pub.close()
        said = []

        def is_reported():
            said.append(capsys.readouterr().err)
            return "'/odom' no longer has a publisher; did you mean '/odom2'? waiting" in "".join(said)

        eventually(is_reported)
        node.new_pub("/odom", latched=True).publish(2)  # the second message ends the command
        running.join()
