"""Tests of the reader: messages from any time on, with bounded reads and memory."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from nep.errors import ClosedError, RecordingError
from nep.recordings.formats.mcap_file import FileWriter
from nep.recordings.reader import Recording
from tests.nep.recordings.messages import START_NS, STEP_NS, json_message, kept, limits, picture, record

PARTS = [
    [json_message(seq, topic=topic) for seq in range(at * 10, at * 10 + 10) for topic in ("/a", "/b")]
    + ([json_message(at, topic="/rare")] if at in {0, 7} else [])
    for at in range(12)
]
ALL = [each for part in PARTS for each in part]


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    record(path, PARTS)
    return path


@pytest.fixture
def recording(path):
    with Recording(path) as opened:
        yield opened


@pytest.fixture(scope="module")
def everything(path):
    with Recording(path) as opened:
        found = list(opened.read())
    assert [kept(each.message) for each in found] == [kept(each) for each in ALL]
    return found


def test_recording_reports_start_count_and_topics(recording, everything):
    assert recording.is_complete
    assert (recording.start_ns, recording.message_count) == (everything[0].log_ns, len(ALL))
    assert [(each.name, each.message_count) for each in recording.topics.values()] == [
        ("/a", 120),
        ("/b", 120),
        ("/rare", 2),
    ]
    assert recording.recorder_metadata["end"] == ""


@settings(max_examples=60)
@given(st.data())
def test_range_read_matches_filtering_of_all_messages(path, everything, data):
    times = st.integers(everything[0].log_ns - 10, everything[-1].log_ns + 10)
    start, end = data.draw(st.one_of(st.none(), times)), data.draw(st.one_of(st.none(), times))
    topics = data.draw(st.one_of(st.none(), st.sets(st.sampled_from(["/a", "/b", "/rare", "/none"]))))
    wanted = [
        (each.log_ns, kept(each.message))
        for each in everything
        if (start is None or each.log_ns >= start)
        and (end is None or each.log_ns < end)
        and (topics is None or each.message.topic in topics)
    ]
    with Recording(path) as opened:
        found = [(each.log_ns, kept(each.message)) for each in opened.read(start, end, topics)]
        assert found == wanted


@settings(max_examples=60)
@given(st.data())
def test_newest_previous_and_next_messages_at_a_time_match_a_linear_search(path, everything, data):
    at = data.draw(st.sampled_from([-1, 0, 2**64 - 1, 2**70, *(each.log_ns for each in everything)]))
    at += data.draw(st.integers(-1, 1))
    wanted = {}
    for each in everything:
        if each.log_ns <= at:
            wanted[each.message.topic] = (each.log_ns, kept(each.message))
    with Recording(path) as opened:
        newest = {topic: (each.log_ns, kept(each.message)) for topic, each in opened.newest(at).items()}
        assert newest == wanted
        times = [each.log_ns for each in everything if each.message.topic == "/a"]
        before, after = opened.before(at, "/a"), opened.after(at, "/a")
        assert (before and before.log_ns) == max((each for each in times if each < at), default=None)
        assert (after and after.log_ns) == min((each for each in times if each > at), default=None)


def test_message_densities_are_counted_without_reading_payloads(recording, everything, monkeypatch):
    monkeypatch.setattr(recording.file, "_chunk", pytest.fail)
    start, end = recording.start_ns, recording.end_ns + 1
    for buckets in (1, 7, 100):
        found = recording.densities(start, end, buckets)
        for topic in ("/a", "/b", "/rare"):
            wanted = [0] * buckets
            for each in everything:
                if each.message.topic == topic:
                    wanted[(each.log_ns - start) * buckets // (end - start)] += 1
            assert found[topic] == wanted
    monkeypatch.setattr("nep.recordings.file_reader._MAX_EXACT_CHUNKS", 0)
    coarse = recording.densities(start, end, 12, ("/a",))
    assert set(coarse) == {"/a"}
    assert sum(coarse["/a"]) == 120
    assert all(abs(each - 10) <= 3 for each in coarse["/a"])
    assert recording.densities(start, end, 0) == recording.densities(end, start, 5) == {}


def test_reader_memory_is_bounded_by_the_cache(path, everything):
    with Recording(path, cache_bytes=1) as opened:
        assert len(list(opened.read())) == len(ALL)
        assert len(opened.file._cache) == 1
        order = list(range(len(everything)))
        random.Random(1).shuffle(order)
        for at in order[:20]:
            assert opened.newest(everything[at].log_ns)
            assert len(opened.file._cache) == 1


def test_unfinished_file_gives_the_same_messages_and_counts_as_the_complete_file(path, everything, tmp_path):
    cut = tmp_path / "cut.mcap"
    with Recording(path) as opened:
        chunks = opened.file.chunks()
    end = chunks[-1].offset + chunks[-1].length + chunks[-1].index_bytes
    cut.write_bytes(path.read_bytes()[:end])
    with Recording(cut) as opened:
        assert not opened.is_complete
        assert [kept(each.message) for each in opened.read()] == [kept(each.message) for each in everything]
        assert opened.newest(everything[50].log_ns).keys() == {"/a", "/b", "/rare"}
        assert {topic: each.received for topic, each in opened.stats().items()} == {
            "/a": 120,
            "/b": 120,
            "/rare": 2,
        }
    cut.write_bytes(
        path.read_bytes()[: chunks[-1].offset + chunks[-1].length]
    )  # and the last index is missing
    with Recording(cut) as opened:
        assert [kept(each.message) for each in opened.read()] == [kept(each.message) for each in everything]
        assert opened.newest(2**64 - 1)["/a"].message.seq == 119
        assert {each.name: each.message_count for each in opened.topics.values()} == {
            "/a": 120,
            "/b": 120,
            "/rare": 2,
        }
        assert sum(opened.densities(opened.start_ns, opened.end_ns + 1, 9)["/a"]) == 120


def test_damaged_chunk_is_skipped_and_counted(path, everything, tmp_path):
    damaged = tmp_path / "damaged.mcap"
    data = bytearray(path.read_bytes())
    with Recording(path) as opened:
        chunk = opened.file.chunks()[5]
    data[chunk.offset + chunk.length // 2] ^= 0x10
    damaged.write_bytes(data)
    with Recording(damaged) as opened:
        found = [each.log_ns for each in opened.read()]
        assert opened.corrupt_range_count == 1
        assert found == [
            each.log_ns for each in everything if not chunk.start_ns <= each.log_ns <= chunk.end_ns
        ]
        opened.newest(chunk.end_ns)
        assert opened.corrupt_range_count == 1


@pytest.mark.parametrize("size", [0, 1, 7, 8, 9, 30, 1000])
def test_random_bytes_folder_and_missing_file_raise_recording_error(tmp_path, size):
    path = tmp_path / "a.mcap"
    path.write_bytes(random.Random(size).randbytes(size))
    with pytest.raises(RecordingError, match=r"a\.mcap': .*MCAP file"):
        Recording(path)
    with pytest.raises(RecordingError):
        Recording(tmp_path)
    with pytest.raises(RecordingError):
        Recording(tmp_path / "nothing.mcap")


def test_reader_recovers_from_random_damage_near_the_end(path, tmp_path):
    data, damaged = path.read_bytes(), tmp_path / "a.mcap"
    rnd = random.Random(4)
    for _each in range(60):
        made = bytearray(data)
        for _flip in range(3):
            made[rnd.randrange(len(data) * 3 // 4, len(data))] = rnd.randrange(256)
        damaged.write_bytes(made)
        with Recording(damaged) as opened:
            assert 0 < len(list(opened.read())) <= len(ALL)


def resummed(data: bytes, changed: dict[str, int]) -> bytes:
    """Return a recording with changed chunk indexes in its summary and without a summary CRC."""
    made = bytearray(data)
    start = int.from_bytes(made[-28:-20], "little")
    places = {"offset": (9 + 16, 8), "length": (9 + 24, 8), "start": (9, 8), "end": (9 + 8, 8)}
    at = start
    while made[at] != 2:
        length = int.from_bytes(made[at + 1 : at + 9], "little")
        if made[at] == 8:
            for name, value in changed.items():
                place, size = places[name]
                made[at + place : at + place + size] = value.to_bytes(size, "little")
        at += 9 + length
    made[-12:-8] = bytes(4)
    return bytes(made)


@pytest.mark.parametrize("name", ["offset", "length"])
@pytest.mark.parametrize("value", [0, 1, 2**31 + 1, 2**63 - 1, 2**64 - 1])
def test_summary_with_invalid_offsets_does_not_break_reading(path, everything, tmp_path, name, value):
    (tmp_path / "a.mcap").write_bytes(resummed(path.read_bytes(), {name: value}))
    with Recording(tmp_path / "a.mcap") as opened:
        found = [each.log_ns for each in opened.read()]
        assert found in ([], [each.log_ns for each in everything])
        opened.newest(2**64 - 1)
        opened.densities(0, 2**64 - 1, 10)


def test_summary_with_invalid_times_does_not_break_reading_or_message_densities(path, everything, tmp_path):
    (tmp_path / "a.mcap").write_bytes(resummed(path.read_bytes(), {"start": 0, "end": 2**64 - 1}))
    with Recording(tmp_path / "a.mcap") as opened:
        assert [each.log_ns for each in opened.read()] == [each.log_ns for each in everything]
        start = everything[0].log_ns
        for number in range(300):
            opened.file._chunks.append(opened.file._chunks[number % 12])
            opened.file._starts.append(0)
            opened.file._latest_ends.append(2**64 - 1)
        counts = opened.densities(start, start + 1000, 1000, ("/a",))["/a"]
        assert len(counts) == 1000
        assert sum(counts) <= 12 * 120


def test_messages_of_overlapping_chunks_are_read_in_order(tmp_path, everything):
    path = tmp_path / "a.mcap"
    record(path, [ALL[:1]])
    with Recording(path) as opened:
        table_of = opened.info.channels
    writer = FileWriter(tmp_path / "b.mcap")
    for number, definition in table_of.items():
        writer.table.add_with_id(number, definition)
    rnd = random.Random(2)
    times = [rnd.randrange(1000) for _each in range(300)]
    for at, log_ns in enumerate(times):
        writer.add(1, (log_ns, 0), at, b"", b"{}")
        if at % 30 == 29:
            writer.flush()
    writer.finish()
    with Recording(tmp_path / "b.mcap") as opened:
        assert [each.log_ns for each in opened.read()] == sorted(times)
        for at in range(-1, 1001, 50):
            wanted = max((each for each in times if each <= at), default=None)
            found = opened.newest(at).get("/a")
            assert (found and found.log_ns) == wanted


def test_empty_recording_has_no_messages(tmp_path):
    record(tmp_path / "a.mcap", [])
    with Recording(tmp_path / "a.mcap") as opened:
        assert (opened.start_ns, opened.duration_s, opened.message_count) == (0, 0.0, 0)
        assert list(opened.read()) == []
        assert opened.newest(5) == opened.densities(0, 10, 5) == {}


def test_recorded_images_are_decoded(tmp_path):
    messages = [picture(seq, kind) for seq, kind in enumerate(("jpeg", "png", "raw"), 1)]
    record(tmp_path / "a.mcap", [messages])
    with Recording(tmp_path / "a.mcap") as opened:
        for found, sent in zip(opened.read(), messages, strict=True):
            assert (found.message.payload == sent.payload).all()


def test_reading_a_closed_recording_raises_closed_error(path):
    opened = Recording(path)
    opened.close()
    opened.close()
    with pytest.raises(ClosedError):
        list(opened.read())


def test_test_clock_times_are_near_the_start_constant(everything):
    assert START_NS < everything[0].log_ns < START_NS + 100 * STEP_NS
    assert limits().min_free_bytes == 0
