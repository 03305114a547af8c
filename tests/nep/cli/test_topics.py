from __future__ import annotations

import json
from pathlib import Path

import pytest

from nep.cli.topics.echo import MessagePrinter, show_record
from nep.cli.topics.publish import parse_payload, wait_for_subscribers
from nep.errors import EncodeError, NepError
from nep.messages.message import Message


def message(data, codec="json", **more):
    return Message("t", data, codec, codec, stamp_ns=1_700_000_000_123_000_000, seq=7, publisher=9, **more)


def record_of(given, capfdbinary):
    show_record(given)
    return json.loads(capfdbinary.readouterr().out)


def test_record_has_all_message_metadata(capfdbinary):
    assert record_of(message('{"a":"Grüße"}'.encode()), capfdbinary) == {
        "topic": "t",
        "msg_type": "json",
        "codec": "json",
        "stamp_ns": 1_700_000_000_123_000_000,
        "seq": 7,
        "publisher": "9",
        "size_bytes": 15,
        "payload": {"a": "Grüße"},
    }


def test_image_is_shown_by_its_shape_without_decoding(capfdbinary):
    given = message(
        b"\xff\xd8\xff no picture", "image", extension={"shape": [240, 320, 3], "encoding": "jpeg"}
    )
    assert record_of(given, capfdbinary)["payload"] == {"shape": [240, 320, 3], "encoding": "jpeg"}


def test_undecodable_payload_is_shown_as_bytes_with_the_reason(capfdbinary):
    record = record_of(message(b"{oops"), capfdbinary)
    assert record["bytes"] == b"{oops".hex()
    assert "can't decode" in record["error"]
    assert "payload" not in record


@pytest.mark.parametrize(
    ("given", "shown"),
    [
        (message(b'{"a":1}'), '{"a":1}'),
        (message("Grüße  日本".encode(), "string"), "Grüße  日本"),
        (message(b"\x00\x01", "bytes"), "2 B: 00 01"),
        (
            message(b"x" * 9000, "image", extension={"shape": [240, 320, 3], "encoding": "jpeg"}),
            "jpeg 320 x 240, 9.0 kB",
        ),
        (message(b"{oops"), "5 B, not valid json: 7b 6f 6f 70 73"),
    ],
)
def test_message_is_printed_on_one_line(given, shown, capsys):
    MessagePrinter()(given)
    out = capsys.readouterr().out
    assert out.count("\n") == 1
    assert "#7" in out
    assert shown in out


def test_message_longer_than_the_screen_is_indented(capsys):
    MessagePrinter()(message(json.dumps({"words": ["message"] * 40}).encode()))
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) > 40
    assert "  {" in lines[1]


@pytest.mark.parametrize(
    ("text", "msg_type", "value"),
    [
        ('{"a": [1, null]}', "json", {"a": [1, None]}),
        ('{"id": "1"}', "robot/command", {"id": "1"}),
        ("2.5", "msgpack", 2.5),
        ("hello world", "string", "hello world"),
        ("Grüße", "bytes", "Grüße".encode()),
    ],
)
def test_argument_is_parsed_according_to_the_message_type(text, msg_type, value):
    assert parse_payload(text, msg_type) == value


def test_invalid_json_error_suggests_the_string_type():
    with pytest.raises(NepError, match=r"'hello' isn't valid JSON; .* --type string"):
        parse_payload("hello", "json")


def test_payload_is_read_from_a_file(tmp_path):
    file = tmp_path / "data"
    file.write_bytes(b'{"a": 1}')
    assert parse_payload(f"@{file}", "json") == {"a": 1}
    assert parse_payload(f"@{file}", "bytes") == b'{"a": 1}'
    with pytest.raises(EncodeError, match="can't read"):
        parse_payload("@/nowhere/at/all", "bytes")
    with pytest.raises(EncodeError, match=r"@image\.jpg"):
        parse_payload("hello", "image")


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="/dev/zero is a device of Unix")
def test_endless_device_is_rejected_as_payload_file(monkeypatch):
    monkeypatch.setattr("nep.cli.topics.publish._MAX_FILE_BYTES", 1000)
    with pytest.raises(EncodeError, match=r"larger than 1\.0 kB"):
        parse_payload("@/dev/zero", "bytes")


def test_publish_waits_for_the_requested_number_of_subscribers(capsys):
    class _Publisher:
        counts = iter([0, 0, 1, 1, 2])

        @property
        def subscribers(self):
            return next(self.counts)

    publisher = _Publisher()
    wait_for_subscribers(publisher, 2)
    assert list(publisher.counts) == []
    assert "2 subscribers" in capsys.readouterr().err
