"""Tests of an open recording as panels see it: topics, series, log, statistics and playback controls."""

from __future__ import annotations

import json
import time

import pytest

from app.core.alerts.alerts import Alerts
from app.core.network.mailbox import Batch
from app.core.recording.replay.replay import Replay, create_graph
from nep.messages.message import Message
from nep.nodes.log_handler import LOG_TOPIC, LOG_TYPE
from nep.recordings.reader import Recording
from tests.nep.recordings.messages import START_NS, STEP_NS, json_message, kept, record

COUNT = 60
LOST = 6 + 2


def line(seq: int) -> Message:
    """Return a message of a program's log."""
    said = {"level": "warn", "node": "arm", "text": f"line {seq}", "pid": 1}
    data = json.dumps(said).encode()
    return Message(LOG_TOPIC, data, "json", LOG_TYPE, stamp_ns=START_NS + seq, seq=seq // 10, publisher=5)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Recording with a message every 10 ms: every tenth a log line, the others on ``/a``.

    Eight sequence numbers of ``/a`` are missing.
    """
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    messages = [
        line(seq) if seq % 10 == 5 else json_message(seq + 2 * (seq > 30), "/a") for seq in range(COUNT)
    ]
    record(path, [messages[:30], messages[30:]])
    return path


@pytest.fixture(scope="module")
def whole(path):
    with Recording(path) as recording:
        return [(log_ns, message) for log_ns, message in recording.read()]


class Shown:
    """Replay without its thread; a tick does the work of the thread first."""

    def __init__(self, path) -> None:
        self.now, self.alerts = 10.0, Alerts()
        self.replay = Replay(path, self.alerts, clock=lambda: self.now)
        self.replay.source.open()
        self.tick(), self.tick()

    def tick(self, passed_s: float = 0.03) -> None:
        self.now += passed_s
        self.replay.source.process()
        self.replay.tick()

    def seek(self, at_ns: int) -> None:
        self.replay.seek(at_ns)
        self.tick()

    def lines(self) -> list[str]:
        return [record.text for record in self.replay.console.records]


@pytest.fixture
def shown(path):
    made = Shown(path)
    yield made
    made.replay.close()


class Taker:
    """Consumer of a series, as a plot is."""

    def __init__(self) -> None:
        self.seqs: list[int | None] = []

    def process(self, batch: Batch, now_ns: int) -> None:
        self.seqs += [message.seq for message in batch.messages]

    def reset(self) -> None:
        self.seqs.clear()


def test_replay_topics_match_file_and_newest_message_follows_playhead(shown, whole):
    topics = shown.replay.topics
    assert [topic.name for topic in topics] == ["/a", LOG_TOPIC]
    assert not any(topic.is_new for topic in topics)
    with shown.replay.watch("/a"):
        for place in (40, 3, 25):
            shown.seek(whole[place][0])
            expected = [message for log_ns, message in whole[: place + 1] if message.topic == "/a"][-1]
            assert kept(topics["/a"].newest) == kept(expected)
            assert topics["/a"].age_s is not None
    assert topics["/a"].newest is None


def test_topic_has_no_newest_message_before_its_first(shown, whole):
    with shown.replay.watch(LOG_TOPIC):
        shown.seek(whole[30][0])
        assert shown.replay.topics[LOG_TOPIC].newest is not None
        shown.seek(whole[0][0])
        assert shown.replay.topics[LOG_TOPIC].newest is None


def test_log_ends_at_playhead_also_after_seeking_back(shown, whole):
    shown.seek(whole[39][0])
    assert shown.lines() == ["line 5", "line 15", "line 25", "line 35"]
    shown.seek(whole[20][0])
    assert shown.lines() == ["line 5", "line 15"]
    shown.replay.play()
    for _ in range(8):
        shown.tick()
    assert shown.lines()[:3] == ["line 5", "line 15", "line 25"]


def test_series_starts_with_messages_before_playhead_and_has_no_duplicates(shown, whole):
    taker = Taker()
    shown.seek(whole[30][0])
    shown.replay.series.register("/a", taker)
    shown.tick()
    seqs = [message.seq for _ns, message in whole if message.topic == "/a"]
    assert taker.seqs == [seq for seq in seqs if seq <= 30]
    shown.replay.play()
    for _ in range(30):
        shown.tick()
    assert taker.seqs == seqs
    shown.seek(whole[10][0])
    assert taker.seqs == [seq for seq in seqs if seq <= 10]


def test_stats_show_losses_and_topic_rate(shown, whole):
    shown.seek(whole[-1][0])
    topic = shown.replay.topics["/a"]
    assert topic.lost == LOST
    assert shown.replay.lost == LOST
    passed_s = (whole[-1][0] - whole[0][0]) / 1e9
    assert topic.rate_hz == pytest.approx(54 / passed_s)
    assert topic.publishers == 1


def test_losses_and_density_are_read_in_background_thread(shown, whole):
    densities = shown.replay.densities
    densities.request(whole[0][0], whole[-1][0] + 1, COUNT)
    end = time.monotonic() + 60
    while densities.newest is None or not densities.losses:
        densities.collect_results()
        assert time.monotonic() < end
    assert sum(densities.newest.counts["/a"]) == 54
    assert sum(mark.count for mark in densities.losses["/a"]) == LOST
    assert "/nowhere" not in densities.newest.counts


def test_user_can_skip_to_bookmark_and_end_and_rename_and_remove_the_bookmark(shown, whole):
    replay = shown.replay
    shown.seek(whole[20][0])
    made = replay.bookmark("here")
    assert made.at_ns == whole[20][0]
    shown.seek(whole[40][0])
    replay.skip(forward=False)
    shown.tick()
    assert replay.player.position_ns == whole[20][0]
    replay.skip(forward=True)
    shown.tick()
    assert replay.player.position_ns == replay.end_ns
    replay.rename_bookmark(made, "there")
    assert [each.name for each in replay.bookmarks] == ["there"]
    replay.remove_bookmark(replay.bookmarks[0])
    assert replay.bookmarks == ()


def test_loop_start_and_end_are_set_at_the_playhead(shown, whole):
    replay = shown.replay
    shown.seek(whole[20][0])
    replay.set_loop_edge(is_start=True)
    shown.tick()
    shown.seek(whole[40][0])
    replay.set_loop_edge(is_start=False)
    shown.tick()
    assert replay.player.loop == (whole[20][0], whole[40][0])
    replay.loop(whole[30][0], whole[30][0])  # an empty range is ignored
    shown.tick()
    assert replay.player.loop == (whole[20][0], whole[40][0])
    replay.toggle_loop()
    shown.tick()
    assert (replay.player.is_looping, replay.player.loop) == (False, None)


@pytest.mark.parametrize(
    ("asked", "given"), [(0.0, 0.1), (-1.0, 0.1), (1e9, 10.0), (float("nan"), 1.0), (2.5, 2.5)]
)
def test_replay_speed_is_clamped_to_its_range_and_nan_becomes_normal_speed(shown, asked, given):
    shown.replay.set_speed(asked)
    shown.tick()
    assert shown.replay.player.speed == given


def test_play_at_end_restarts_from_beginning(shown, whole):
    shown.seek(2**64 - 1)
    shown.replay.toggle()
    shown.tick()
    assert shown.replay.player.position_ns == whole[0][0]
    assert shown.replay.player.is_playing


def test_stepping_through_missing_topic_does_nothing(shown):
    shown.replay.select_topic("/nowhere")
    assert shown.replay.selected_topic == "/a"
    shown.replay.selected_topic = "/nowhere"
    before = shown.replay.player.position_ns
    shown.replay.step(forward=True)
    shown.tick()
    assert shown.replay.player.position_ns == before


def test_unplayable_recording_is_an_alert_and_ends_the_thread(tmp_path):
    path = tmp_path / "broken.mcap"
    path.write_bytes(b"no recording")
    alerts = Alerts()
    replay = Replay(path, alerts)
    replay.start()
    end = time.monotonic() + 60
    while not replay.has_ended:
        assert time.monotonic() < end
    replay.tick()
    assert replay.status.stage == "failed"
    assert [alert.severity for alert in alerts.active] == ["error"]
    replay.close()


def test_truncated_recording_is_an_alert(tmp_path, path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(path.read_bytes()[:-3000])
    made = Shown(cut)
    assert [alert.id for alert in made.alerts.active] == ["recording:not-closed"]
    made.replay.close()


def test_topic_without_sequence_numbers_is_listed_with_unknown_losses(tmp_path):
    path = tmp_path / "original.mcap"
    record(path, [[Message("/original", b"{}", "json", "json")]])
    with Recording(path) as recording:
        view = create_graph(recording.topics, recording.stats())
    assert len(view.topics["/original"].publishers) == 1
    assert view.topics["/original"].lost is None


def test_messages_of_the_sample_recording_are_one_step_apart(whole):
    assert whole[1][0] - whole[0][0] == STEP_NS
