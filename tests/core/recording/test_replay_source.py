"""Tests of the replay source: messages identical to the live ones, up to the playhead, also after seeking."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from app.core.network.mailbox import MAX_MESSAGES_PER_TOPIC
from app.core.recording.replay.source import ReplayResults, ReplaySource
from nep.errors import RecordingError
from nep.messages.message import Message
from nep.recordings.player import Playback
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings.messages import STEP_NS, TestClock, json_message, kept, limits, picture, record

COUNT = 90


class Clock:
    """Fake clock that advances only when a test sets it."""

    def __init__(self) -> None:
        self.now = 50.0

    def __call__(self) -> float:
        return self.now


class Pictures:
    """Fake image streams that record the offered images."""

    def __init__(self) -> None:
        self.shown: dict[str, Message] = {}

    def offer(self, messages):
        self.shown.update({each.topic: each for each in messages})

    def reset(self, topics):
        self.shown = {topic: each for topic, each in self.shown.items() if topic in topics}


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Recording that alternates ``/a`` and ``/b``, with an image in the middle and ``/rare`` twice."""
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    messages = [json_message(seq, topic=("/a", "/b")[seq % 2]) for seq in range(COUNT)]
    messages[45] = picture(45)
    messages[20], messages[60] = json_message(20, "/rare"), json_message(60, "/rare")
    record(path, [messages[:30], messages[30:60], messages[60:]])
    return path


@pytest.fixture(scope="module")
def whole(path):
    """All (time in ns, message) pairs of the recording."""
    with Recording(path) as recording:
        return [(log_ns, message) for log_ns, message in recording.read()]


class Replayed:
    """Replay source without its thread, advanced by the test."""

    def __init__(self, path: Path, *topics: str) -> None:
        self.clock, self.pictures = Clock(), Pictures()
        self.source = ReplaySource(path, self.pictures, clock=self.clock)
        for topic in topics:
            self.source.watch(topic)
        self.source.open()
        self.source.process()

    def do(self, change) -> ReplayResults:
        self.source.queue_change("test", change)
        self.source.process()
        return self.source.pop_results()

    def pass_time(self, seconds: float, step_s: float = 0.004) -> ReplayResults:
        end = self.clock.now + seconds
        while self.clock.now < end:
            self.source.process()
            self.clock.now += step_s
        return self.source.pop_results()


@pytest.fixture
def replay(path):
    made = []

    def begin(*topics: str, path: Path = path) -> Replayed:
        made.append(Replayed(path, *topics))
        return made[-1]

    yield begin
    for each in made:
        each.source.close()


def of(handed: ReplayResults, topic: str) -> list[Message]:
    batch = handed.batches.get(topic)
    return batch.messages if batch is not None else []


def newest(whole, topic: str, at_ns: int) -> tuple[object, ...] | None:
    found = [message for log_ns, message in whole if message.topic == topic and log_ns <= at_ns]
    return kept(found[-1]) if found else None


def test_replayed_messages_are_byte_identical(replay, whole):
    played = replay("/a", "/b", "/camera", "/rare")
    first = played.source.pop_results()
    handed = played.do(Playback.play)
    assert first.seek_messages is not None
    handed = played.pass_time(2.0)
    for topic in ("/a", "/b", "/rare", "/camera"):
        came = [*(each for each in first.seek_messages if each.topic == topic), *of(handed, topic)]
        assert [kept(each) for each in came] == [kept(m) for _ns, m in whole if m.topic == topic]
    status = played.source.status.player
    assert (status.is_playing, status.is_at_end) == (False, True)
    assert kept(played.pictures.shown["/camera"]) == newest(whole, "/camera", 2**63)


@pytest.mark.parametrize("seed", range(4))
def test_seek_delivers_newest_message_of_each_topic_up_to_playhead(replay, whole, seed):
    topics, chance = ("/a", "/b", "/rare", "/camera"), random.Random(seed)
    played = replay(*topics)
    start_ns, end_ns = whole[0][0], whole[-1][0]
    for _ in range(12):
        at_ns = chance.randint(start_ns, end_ns)
        handed = played.do(lambda playback, at_ns=at_ns: playback.seek(at_ns))
        found = {each.topic: kept(each) for each in handed.seek_messages}
        expected = {topic: newest(whole, topic, at_ns) for topic in topics}
        assert found == {topic: each for topic, each in expected.items() if each is not None}
        assert ("/camera" in played.pictures.shown) == (expected["/camera"] is not None)
        assert handed.batches == {}


def test_seek_discards_undelivered_messages(replay, whole):
    played = replay("/a")
    played.do(Playback.play)
    for _ in range(40):
        played.source.process()
        played.clock.now += 0.01
    handed = played.do(lambda playback: playback.seek(whole[0][0]))
    assert [each.seq for each in handed.seek_messages] == [0]
    assert handed.batches == {}


def test_seek_is_clamped_to_the_recording(replay, whole):
    played = replay("/a")
    end_ns = played.source.opened_recording.recording.end_ns
    assert end_ns >= whole[-1][0]
    for at_ns, expected in ((-1, whole[0][0]), (0, whole[0][0]), (2**64 - 1, end_ns)):
        played.do(lambda playback, at_ns=at_ns: playback.seek(at_ns))
        assert played.source.status.player.position_ns == expected


def test_only_last_of_many_seeks_is_executed(replay, whole):
    played = replay("/a")
    for log_ns, _message in whole:
        played.source.queue_change("seek", lambda playback, at_ns=log_ns: playback.seek(at_ns))
    assert len(played.source._queued_changes) == 1
    played.source.process()
    assert played.source.status.player.position_ns == whole[-1][0]


def test_late_watch_receives_newest_message_and_all_later_ones(replay, whole):
    played = replay("/a")
    played.source.pop_results()
    played.do(Playback.play)
    played.pass_time(0.4)
    played.source.watch("/b")
    played.source.process()
    came = of(played.source.pop_results(), "/b")
    at_ns = played.source.status.player.position_ns
    came = [each for each in came if each.seq <= (at_ns - whole[0][0]) // STEP_NS]
    assert kept(came[0]) == newest(whole, "/b", whole[0][0] + came[0].seq * STEP_NS)
    came += of(played.pass_time(2.0), "/b")
    seqs = [message.seq for _ns, message in whole if message.topic == "/b"]
    assert [each.seq for each in came] == [seq for seq in seqs if seq >= came[0].seq]


def test_unwatched_topic_delivers_nothing(replay):
    played = replay("/a", "/b")
    played.do(Playback.play)
    played.source.unwatch("/b")
    played.source.process()
    played.source.pop_results()
    handed = played.pass_time(0.5)
    assert of(handed, "/a")
    assert not of(handed, "/b")


def test_step_moves_between_messages_of_one_topic_and_pauses(replay, whole):
    played = replay("/a", "/rare")
    played.do(Playback.play)
    handed = played.do(lambda playback: playback.step("/rare"))
    assert {each.topic: each.seq for each in handed.seek_messages} == {"/a": 18, "/rare": 20}
    handed = played.do(lambda playback: playback.step("/rare"))
    assert {each.topic: each.seq for each in handed.seek_messages}["/rare"] == 60
    handed = played.do(lambda playback: playback.step("/rare", forward=False))
    assert {each.topic: each.seq for each in handed.seek_messages}["/rare"] == 20
    assert not played.source.status.player.is_playing
    assert played.do(lambda playback: playback.step("/rare", forward=False)).seek_messages is None


def test_loop_replays_its_part_repeatedly(replay, whole):
    played = replay("/a")
    start_ns = whole[10][0]
    played.do(lambda playback: playback.loop(start_ns, start_ns + 20 * STEP_NS))
    played.do(Playback.play)
    seen = set()
    for _ in range(300):
        handed = played.pass_time(0.01)
        seen.add(handed.seek_messages is not None)
        position_ns = played.source.status.player.position_ns
        assert start_ns <= position_ns <= start_ns + 20 * STEP_NS
    assert seen == {True, False}
    assert played.source.status.player.is_playing


def test_slow_window_drops_and_counts_messages_while_playhead_stays_correct(tmp_path, replay):
    count = 4 * MAX_MESSAGES_PER_TOPIC
    path = tmp_path / "fast.mcap"
    with RecordingWriter(path, clock=TestClock(step_ns=1_000_000), limits=limits()) as writer:
        for seq in range(count):
            writer.post([json_message(seq, "/a")])
        assert writer.flush()
    played = replay("/a", path=path)
    played.source.pop_results()
    played.do(Playback.play)
    handed = played.pass_time(5.0)
    batch = handed.batches["/a"]
    assert (len(batch.messages), batch.arrived_count) == (MAX_MESSAGES_PER_TOPIC, count - 1)
    assert batch.messages[-1].seq == count - 1
    assert played.source.status.player.position_ns == played.source.opened_recording.recording.end_ns


def test_small_messages_do_not_retain_their_file_chunk(replay):
    played = replay("/a")
    handed = played.do(lambda playback: playback.seek(2**63))
    assert all(type(each.raw) is bytes for each in handed.seek_messages)


def test_plot_receives_messages_before_the_playhead(replay, whole):
    played = replay()
    played.source.pop_results()
    at_ns = whole[50][0]
    played.do(lambda playback: playback.seek(at_ns))
    played.source.set_history_capacity("/a", 8192)
    played.source.watch("/a")
    played.source.process()
    handed = played.source.pop_results()
    before = [message.seq for log_ns, message in whole if message.topic == "/a" and log_ns <= at_ns]
    assert [each.seq for each in handed.history["/a"]] == before
    assert not of(handed, "/a")
    handed = played.do(lambda playback: playback.seek(whole[10][0]))
    assert [each.seq for each in handed.history["/a"]] == [seq for seq in before if seq <= 10]


def test_stats_follow_the_playhead(replay, whole):
    played = replay()
    handed = played.do(lambda playback: playback.seek(whole[59][0]))
    assert handed.stats["/rare"].newest_ns == whole[20][0]
    assert handed.stats["/rare"].rate_hz == pytest.approx(1 / ((whole[59][0] - whole[0][0]) / 1e9))
    handed = played.do(lambda playback: playback.seek(whole[5][0]))
    assert handed.stats["/rare"].newest_ns is None
    assert handed.stats["/rare"].rate_hz == 0.0


def test_truncated_recording_is_opened_without_modifying_it(tmp_path, path, whole):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-400])
    before = cut.read_bytes()
    played = Replayed(cut, "/a")
    opened = played.source.opened_recording
    assert not opened.recording.is_complete
    assert opened.recording.message_count == COUNT
    played.source.close()
    assert cut.read_bytes() == before
    assert list(tmp_path.iterdir()) == [cut]


@pytest.mark.parametrize("content", [b"", b"no recording", bytes(5000)])
def test_opening_an_invalid_recording_raises_and_creates_no_file(tmp_path, content):
    path = tmp_path / "broken.mcap"
    path.write_bytes(content)
    source = ReplaySource(path, Pictures(), clock=Clock())
    with pytest.raises(RecordingError):
        source.open()
    assert list(tmp_path.iterdir()) == [path]


def test_opening_an_empty_recording_raises(tmp_path):
    path = tmp_path / "empty.mcap"
    record(path, [])
    source = ReplaySource(path, Pictures(), clock=Clock())
    with pytest.raises(RecordingError, match="no readable messages"):
        source.open()
