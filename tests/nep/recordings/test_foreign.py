"""Tests of files that other programs wrote, in every variant of the specification, and of damaged files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import typer
from mcap.writer import CompressionType, IndexType, Writer

from nep.cli.app import app
from nep.errors import NepError, RecordingError
from nep.recordings.export import Part, export
from nep.recordings.reader import Recording
from nep.recordings.repair import repair
from tests.nep.recordings import hostile
from tests.nep.recordings.messages import json_message, record
from tests.nep.recordings.test_commands import run

SECOND = 10**9
COUNT = 50


def written(path: Path, **options: object) -> Path:
    """Write another program's file: 50 messages on /wheel, one on /lamp, an attachment and metadata."""
    with path.open("wb") as file:
        writer = Writer(file, **options)  # type: ignore[arg-type]
        writer.start(profile="ros2", library="another tool")
        schema = writer.register_schema("Speed", "jsonschema", b"{}")
        wheel = writer.register_channel("/wheel", "json", schema)
        lamp = writer.register_channel("/lamp", "cdr", 0)
        writer.add_attachment(1, 1, "map.png", "image/png", b"x" * 1000)
        writer.add_metadata("robot", {"serial": "12"})
        for number in range(COUNT):
            writer.add_message(wheel, SECOND + number * 10**7, b'{"rpm": %d}' % number, SECOND)
        writer.add_message(lamp, 2 * SECOND, b"\0\1\0\0\1", 2 * SECOND)
        writer.finish()
    return path


KINDS: dict[str, dict[str, object]] = {
    "chunks": {},
    "small chunks": {"chunk_size": 200},
    "no chunks": {"use_chunking": False},
    "no chunks, no summary": {
        "use_chunking": False,
        "index_types": IndexType.NONE,
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_schemas": False,
        "repeat_channels": False,
    },
    "no summary": {
        "index_types": IndexType.NONE,
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_schemas": False,
        "repeat_channels": False,
    },
    "no chunk index": {"index_types": IndexType.MESSAGE},
    "no message index": {"index_types": IndexType.CHUNK},
    "channels not repeated": {"repeat_channels": False, "repeat_schemas": False},
    "lz4": {"compression": CompressionType.LZ4},
    "not compressed": {"compression": CompressionType.NONE},
}


@pytest.mark.parametrize("kind", KINDS)
def test_every_mcap_variant_of_other_programs_is_read(tmp_path: Path, kind: str) -> None:
    path = written(tmp_path / "theirs.mcap", **KINDS[kind])
    with Recording(path) as recording:
        assert recording.is_complete
        payloads = [each.message.payload for each in recording.read(topics=["/wheel"])]
        assert payloads == [{"rpm": number} for number in range(COUNT)]
        assert {each.name: each.message_count for each in recording.topics.values()} == {
            "/lamp": 1,
            "/wheel": COUNT,
        }
        assert (recording.start_ns, recording.end_ns) == (SECOND, 2 * SECOND)
        assert recording.newest(SECOND + 105 * 10**6)["/wheel"].message.payload == {"rpm": 10}
        assert sum(recording.densities(SECOND, 2 * SECOND, 7)["/wheel"]) == COUNT
        assert ("robot", {"serial": "12"}) in recording.info.metadata
        assert [each.name for each in recording.info.attachments] == ["map.png"]
        assert not recording.corruption
    assert [each.name for each in tmp_path.iterdir()] == ["theirs.mcap"]


def test_truncated_file_without_chunks_is_incomplete_and_can_be_repaired(tmp_path: Path) -> None:
    path = written(tmp_path / "theirs.mcap", use_chunking=False)
    data = path.read_bytes()
    path.write_bytes(data[: data.index(b'{"rpm": 30}') + 3])
    with Recording(path) as recording:
        assert not recording.is_complete
        assert len(list(recording.read())) == 30
    report = repair(path, tmp_path / "closed.mcap")
    assert report.recovered == 30


def test_messages_outside_chunks_are_found(tmp_path: Path) -> None:
    path = tmp_path / "both.mcap"
    written(path)
    data = path.read_bytes()
    plain = written(tmp_path / "plain.mcap", use_chunking=False).read_bytes()
    at = plain.index(b'{"rpm": 7}') - 31
    length = 9 + int.from_bytes(plain[at + 1 : at + 9], "little")
    end = data.index(b"\x0f\x04\0\0\0\0\0\0\0")  # DataEnd
    with_message = data[:end] + plain[at : at + length] + data[end : end + 13]
    path.write_bytes(with_message + b"\x02" + (20).to_bytes(8, "little") + bytes(20) + data[-8:])
    with Recording(path) as recording:
        assert recording.topics["/wheel"].message_count == COUNT + 1


def test_info_command_lists_encodings_schemas_compression_attachments_and_metadata(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path / "theirs.mcap")
    run("recording", "info", path)
    said = capfd.readouterr()
    for words in (
        "another tool",
        "ros2",
        "zstd",
        "cdr",
        "jsonschema",
        "Speed",
        "map.png",
        "image/png",
        "serial",
    ):
        assert words in said.out
    assert not said.err
    run("recording", "info", path, "--json")
    told = json.loads(capfd.readouterr().out)
    assert told["topics"]["/lamp"] | {"figures": 0} == {
        "msg_type": "bytes",
        "codec": "bytes",
        "encoding": "cdr",
        "schema_encoding": "",
        "message_count": 1,
        "figures": 0,
    }
    assert (told["compressions"], told["profile"], told["damage"]) == ({"zstd": 1}, "ros2", [])
    assert told["attachments"] == [{"name": "map.png", "media_type": "image/png", "size_bytes": 1000}]


def test_exported_range_keeps_encodings_schemas_and_metadata_without_loss_counts(tmp_path: Path) -> None:
    path = written(tmp_path / "theirs.mcap", chunk_size=200)
    with Recording(path) as recording:
        part = Part(SECOND, SECOND + 200_000_000)
        (made,) = export(recording, "mcap", tmp_path / "part", part)
    assert made.count == 20
    with Recording(made.path) as recording:
        assert recording.stats() == {}
        assert {each.name: each.message_count for each in recording.topics.values()} == {
            "/lamp": 0,
            "/wheel": 20,
        }
        assert recording.topics["/lamp"].encoding == "cdr"
        assert recording.topics["/wheel"].schema_encoding == "jsonschema"
        assert recording.info.profile == "ros2"
        assert ("robot", {"serial": "12"}) in recording.info.metadata
        assert [bytes(raw.data) for raw in recording.read_raw()] == [b'{"rpm": %d}' % n for n in range(20)]


def damaged(path: Path) -> Path:
    """Write a recording of 40 messages in four chunks, of which the third is damaged."""
    record(path, [[json_message(seq) for seq in range(at * 10, at * 10 + 10)] for at in range(4)])
    with Recording(path) as recording:
        chunk = recording.file.chunks()[2]  # type: ignore[attr-defined]
    data = bytearray(path.read_bytes())
    data[chunk.offset + chunk.length // 2] ^= 0x10
    path.write_bytes(data)
    return path


def test_commands_report_missing_messages_of_a_damaged_file_and_exit_with_1(
    tmp_path: Path, master: object, capfd: pytest.CaptureFixture[str]
) -> None:
    path = damaged(tmp_path / "damaged.mcap")
    commands = [
        ("recording", "info", path),
        ("recording", "export", path, "-o", tmp_path / "out"),
        ("play", path, "--all", "--speed", 10, "--master", master.address),  # type: ignore[attr-defined]
    ]
    for words in commands:
        assert app([str(each) for each in words], standalone_mode=False) == 1
        assert "10 messages are missing" in capfd.readouterr().err
    assert (tmp_path / "out" / "odom.csv").read_text().count("\n") == 31
    assert sorted(each.name for each in tmp_path.iterdir()) == ["damaged.mcap", "out"]


def test_playing_an_empty_recording_raises(tmp_path: Path) -> None:
    empty = tmp_path / "empty.mcap"
    record(empty, [])
    with pytest.raises(NepError, match="nothing to play"):
        run("play", empty, "--all")


def test_playing_too_many_topics_at_once_is_rejected(tmp_path: Path) -> None:
    path = tmp_path / "many.mcap"
    path.write_bytes(hostile.many_channels(1_001))
    with pytest.raises(NepError, match="1001 matching topics"):
        run("play", path, "--all")


def test_recording_of_one_message_is_played_to_its_end(
    tmp_path: Path, master: object, capfd: pytest.CaptureFixture[str]
) -> None:
    record(tmp_path / "one.mcap", [[json_message(1)]])
    run("play", tmp_path / "one.mcap", "--all", "--master", master.address)  # type: ignore[attr-defined]
    assert "published 1 message" in capfd.readouterr().err


def test_topic_names_of_a_file_are_escaped_in_error_messages(tmp_path: Path) -> None:
    name = "/a\x1b]0;owned\x07"
    path = tmp_path / "names.mcap"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        writer.add_message(writer.register_channel(name, "json", 0), 1, b"{}", 1)
        writer.finish()
    for words in ((), ("/a]0;owne",), ("/b",)):
        with pytest.raises(typer.BadParameter.__mro__[1]) as raised:
            run("play", path, *words)
        assert "\x1b" not in str(raised.value)
        assert "owned" in str(raised.value)


def test_file_with_only_magic_bytes_is_incomplete_and_cannot_be_repaired(tmp_path: Path) -> None:
    (tmp_path / "a.mcap").write_bytes(b"\x89MCAP0\r\n")
    with Recording(tmp_path / "a.mcap") as recording:
        assert not recording.is_complete
    with pytest.raises(RecordingError):
        repair(tmp_path / "a.mcap", tmp_path / "b.mcap")


def test_exported_range_of_a_nep_recording_has_loss_counts_of_that_range(tmp_path: Path) -> None:
    messages = [json_message(seq) for seq in (1, 2, 3, 5, 6, 9)]
    record(tmp_path / "a.mcap", [messages])
    with Recording(tmp_path / "a.mcap") as recording:
        times = [each.log_ns for each in recording.read()]
        (made,) = export(recording, "mcap", tmp_path / "out", Part(times[1], times[5]))
    with Recording(made.path) as recording:
        figures = recording.stats()["/odom"]
        assert (figures.received, figures.lost, figures.late) == (4, 1, 0)
        assert [each.message.seq for each in recording.read()] == [2, 3, 5, 6]
