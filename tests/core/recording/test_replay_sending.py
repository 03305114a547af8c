"""Tests of publishing a replayed recording on the live network: selected topics, unchanged, in time."""

from __future__ import annotations

from pathlib import Path

import pytest

import nep
from app.core.recording.replay.sending import MAX_DELAY_S, ReplayOutbox, ReplayRoute, sent_text
from app.core.recording.replay.source import ReplaySource
from app.core.robots.motion.gate import MotionGate
from app.core.robots.motion.permission import MotionPermission
from app.core.run.acting.arming import MAX_TARGETS, Arming, Target
from app.core.session import Session
from app.robots.description.description import parse
from nep.errors import ClosedError
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView
from nep.recordings.player import Playback
from nep.recordings.reader import Recording
from tests.core.recording.test_replay_source import Clock, Pictures
from tests.core.robots.test_motion_gate import TOPIC, Robots, description
from tests.core.waiting import tick_until
from tests.nep.recordings.messages import json_message, kept, picture, record

COUNT = 60


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recording that alternates ``/a`` and ``/b`` every 10 ms.

    It has an image in the middle and a velocity command of a base at the end.
    """
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    messages = [json_message(seq, topic=("/a", "/b")[seq % 2]) for seq in range(COUNT)]
    messages[31] = picture(31)
    messages[COUNT - 1] = json_message(COUNT - 1, "/base/cmd_vel")
    record(path, [messages])
    return path


@pytest.fixture(scope="module")
def whole(path: Path) -> list[tuple[int, Message]]:
    with Recording(path) as recording:
        return [(log_ns, message) for log_ns, message in recording.read()]


class Played:
    """Replay source without its thread, and the messages that it forwards."""

    def __init__(self, path: Path, sent: set[str], watched: str = "") -> None:
        self.clock = Clock()
        self.source = ReplaySource(path, Pictures(), clock=self.clock)
        if watched:
            self.source.watch(watched)
        self.source.open()
        self.source.process()
        self.messages: list[Message] = []
        self.late: list[float] = []
        self.source.forward(sent, self._take)
        self.source.process()

    def _take(self, messages: list[Message], late_s: list[float]) -> None:
        self.messages += messages
        self.late += late_s

    def do(self, change: object) -> None:
        self.source.queue_change("test", change)  # type: ignore[arg-type]
        self.source.process()

    def pass_time(self, seconds: float, step_s: float = 0.004) -> None:
        end = self.clock.now + seconds
        while self.clock.now < end:
            self.source.process()
            self.clock.now += step_s

    def taken(self) -> list[tuple[object, ...]]:
        found, self.messages = [kept(each) for each in self.messages], []
        return found


@pytest.fixture
def played(path: Path):
    made: list[Played] = []

    def begin(*topics: str, watched: str = "") -> Played:
        made.append(Played(path, set(topics), watched))
        return made[-1]

    yield begin
    for each in made:
        each.source.close()


def some(whole, *topics: str, begin: int = 0, end: int = COUNT):
    return [kept(message) for _ns, message in whole[begin:end] if message.topic in topics]


def test_selected_topics_are_sent_completely_and_panels_receive_watched_topics(played, whole):
    sender = played("/a", "/camera", watched="/b")
    assert sender.taken() == []  # messages read for the initial display aren't sent
    sender.do(Playback.play)
    sender.pass_time(2.0)
    assert sender.taken() == some(whole, "/a", "/camera")
    assert max(sender.late) < MAX_DELAY_S
    assert set(sender.source.pop_results().batches) == {"/b"}
    sender.do(lambda playback: playback.seek(whole[0][0]))
    sender.do(Playback.play)
    sender.pass_time(2.0)
    assert sender.taken() == some(whole, "/a", "/camera")


def test_seek_sends_no_skipped_messages_and_pause_sends_nothing(played, whole):
    sender = played("/a", "/b")
    sender.do(Playback.play)
    sender.pass_time(0.1)
    before = sender.taken()
    assert before == some(whole, "/a", "/b")[: len(before)]
    sender.do(lambda playback: playback.seek(whole[40][0]))
    assert sender.taken() == []
    sender.do(Playback.pause)
    sender.pass_time(0.2)
    sender.do(lambda playback: playback.step("/a", forward=True))
    sender.pass_time(0.2)
    assert sender.taken() == []
    sender.do(lambda playback: playback.seek(whole[50][0]))
    sender.do(Playback.play)
    sender.pass_time(1.0)
    assert sender.taken() == some(whole, "/a", "/b", begin=51)


def test_loop_sends_only_the_messages_of_the_looped_part(played, whole):
    sender = played("/a", "/b")
    begin, end = 10, 20
    sender.do(lambda playback: playback.loop(whole[begin][0], whole[end][0]))
    sender.do(Playback.play)
    sender.pass_time(0.35)
    part, sent = some(whole, "/a", "/b", begin=begin, end=end + 1), sender.taken()
    assert len(sent) > 2 * len(part)
    assert sent == (part * 4)[: len(sent)]


def test_late_replay_sends_no_burst_and_sending_follows_the_replay_speed(played):
    sender = played("/a", "/b")
    sender.do(Playback.play)
    sender.pass_time(0.1)
    sender.taken(), sender.late.clear()
    sender.clock.now += 20.0  # as after the computer was suspended
    sender.source.process()
    assert max(sender.late) > MAX_DELAY_S
    assert 0 < sum(late <= MAX_DELAY_S for late in sender.late) <= round(MAX_DELAY_S / 0.01) + 1
    quick = played("/a", "/b")
    quick.do(lambda playback: setattr(playback, "speed", 10.0))
    quick.do(Playback.play)
    quick.pass_time(0.02)
    assert 15 <= len(quick.messages) <= 25


def test_watch_on_sent_topic_receives_its_newest_message(played, whole):
    sender = played("/a")
    sender.do(Playback.play)
    sender.pass_time(0.2)
    sender.do(Playback.pause)
    sender.source.pop_results()
    sender.source.watch("/a")
    sender.source.process()
    shown = sender.source.pop_results().batches["/a"].messages
    assert [kept(each) for each in shown] == [sender.taken()[-1]]


class TestPublisher:
    """Fake publisher with two subscribers that records what is published."""

    __test__ = False

    def __init__(self, topic: str, msg_type: str, latched: bool) -> None:
        self.made, self.sent, self.is_closed = (topic, msg_type, latched), [], False
        self.subscribers = 2

    def publish_bytes(self, data: bytes, extension: object) -> None:
        if self.is_closed:
            raise ClosedError("publisher")
        self.sent.append((data, extension))

    def close(self) -> None:
        self.is_closed = True


class TestNode:
    """Fake node that creates `TestPublisher` objects; the topic ``/bad`` can't be published."""

    __test__ = False

    def __init__(self) -> None:
        self.made: list[TestPublisher] = []

    def graph(self, _timeout_s: float) -> GraphView:
        return GraphView(0, 0)

    def new_pub(self, topic: str, msg_type: str, *, latched: bool) -> TestPublisher:
        if topic == "/bad":
            raise ClosedError("node")
        self.made.append(TestPublisher(topic, msg_type, latched))
        return self.made[-1]


def test_replay_omits_messages_that_would_move_a_newly_connected_robot():
    node, jobs, arming, robots = TestNode(), [], Arming(), Robots()
    gate = MotionGate(MotionPermission(), robots)
    outbox = ReplayOutbox(arming, lambda _what, job: jobs.append(job), gate)
    arming.arm()
    arming.allow(Target("topic", TOPIC))
    outbox.start(ReplayRoute("/a", TOPIC), arming.turn, "json", is_latched=False)
    jobs.pop()(node)
    (sent,) = outbox.active_topics
    outbox.offer([json_message(1, "/a")], [0.0])
    assert (sent.count, sent.dropped_count) == (1, 0)
    robots.come(parse(description(virtual=False)))
    gate.update()
    outbox.offer([json_message(2, "/a")], [0.0])
    assert (sent.count, sent.dropped_count) == (1, 1)


def test_outbox_sends_messages_of_its_topic_until_disarmed_and_counts_dropped_messages():
    node, jobs, arming = TestNode(), [], Arming()
    outbox = ReplayOutbox(arming, lambda _what, job: jobs.append(job))
    arming.arm()
    arming.allow(Target("topic", "/test"))
    outbox.start(ReplayRoute("/a", "/test"), arming.turn, "json", is_latched=True)
    (sent,) = outbox.active_topics
    messages = [json_message(1, "/a"), json_message(2, "/b"), json_message(3, "/a")]
    outbox.offer(messages, [0.0] * 3)
    assert (sent.count, sent.dropped_count) == (0, 0)  # nothing is counted before the publisher exists
    jobs.pop()(node)
    outbox.offer(messages, [0.0, 0.0, MAX_DELAY_S + 0.01])
    assert (sent.count, sent.dropped_count, sent.subscriber_count) == (1, 1, 2)
    assert sent_text(sent) == "1 sent, 1 late message skipped"
    assert node.made[0].made == ("/test", "json", True)
    assert node.made[0].sent == [(bytes(messages[0].data), None)]
    typed = Message("/a", b'{"x":1}', "json", "geometry_msgs/Point")
    outbox.offer([typed], [0.0])
    jobs.pop()(node)
    outbox.offer([typed], [0.0])
    assert [each.made[1] for each in node.made] == ["json", "geometry_msgs/Point"]
    assert (sent.count, sent.dropped_count) == (2, 2)
    arming.disarm()
    outbox.offer(messages, [0.0] * 3)
    arming.arm()
    arming.allow(Target("topic", "/test"))
    outbox.offer(messages, [0.0] * 3)  # arming again doesn't resume sending that has ended
    assert sent.count == 2
    assert outbox.stop("/a") is sent
    assert outbox.stop("/a") is None
    jobs.pop()(node)
    assert all(each.is_closed for each in node.made)
    outbox.start(ReplayRoute("/a", "/bad"), arming.turn, "json", is_latched=False)
    jobs.pop()(node)
    assert outbox.active_topics[0].problem


def open_and_know(session: Session, path: Path):
    replay = session.open_recording(path)
    tick_until(session, lambda: replay.opened_recording is not None)
    session.tick()  # the source has changed, which disarms
    sending = replay.sending
    assert sending is not None
    sending.analyze()
    tick_until(session, lambda: sending.is_analyzed)
    return replay, sending


def heard_of(heard: list[Message]) -> list[Message]:
    return [each for each in heard if each.topic in ("/test/a", "/camera")]


def test_replayed_topic_is_received_under_its_new_name_until_stop(
    session: Session, path: Path, whole
) -> None:
    acting = session.acting
    with nep.node("hears") as node:
        heard: list[Message] = []
        node.new_sub("**", sink=heard.extend)
        replay, sending = open_and_know(session, path)
        assert acting.arm() == "A recording is open. Return to live to send."
        assert sending.arm() == "Choose a topic first."
        assert sending.select("/a", "two words") != ""
        assert sending.select("/nowhere", "") == ""
        assert sending.select("/a", "/test/a") == sending.select("/camera", "") == ""
        replay.play()
        tick_until(session, lambda: replay.player is not None and replay.player.is_at_end)
        assert not [each for each in heard if each.topic in ("/a", "/test/a", "/camera")]
        assert sending.arm() == ""
        assert acting.arming.targets == (Target("topic", "/test/a"), Target("topic", "/camera"))
        going = sending.outbox.active_topics
        tick_until(session, lambda: all(sent.is_ready and sent.subscriber_count for sent in going))
        replay.play()
        expected = [m for _ns, m in whole if m.topic in ("/a", "/camera")]
        tick_until(session, lambda: sum(each.count + each.dropped_count for each in going) == len(expected))
        tick_until(session, lambda: len(heard_of(heard)) == sum(each.count for each in going))
        left = iter([(m.msg_type, bytes(m.data)) for m in expected])
        came = [(m.msg_type, bytes(m.data)) for m in heard_of(heard)]
        assert came
        assert all(each in left for each in came)  # in order; a slow computer may skip some
        assert not [m for m in heard if m.topic in ("/a", "/b")]
        session.runs.stop()
        assert not acting.arming.is_on
        session.tick()
        assert sending.outbox.active_topics == ()
    said = [each.text for each in session.console.records]
    assert "/test/a: /a of the recording, sent during playback" in said
    assert f"/test/a: /a of the recording, {sent_text(going[0])}" in said
    assert f"/camera: {sent_text(going[1])}" in said


def test_motion_commands_need_confirmation_even_under_another_name(session: Session, path: Path) -> None:
    acting = session.acting
    replay, sending = open_and_know(session, path)
    for recorded, name in (("/base/cmd_vel", "/harmless"), ("/b", "/arm/command"), ("/a", "")):
        assert sending.select(recorded, name) == ""
    assert sending.moves_robot("/base/cmd_vel", "/harmless")
    assert sending.arm() == ""
    assert [sent.route.recorded for sent in sending.outbox.active_topics] == ["/a"]
    question = acting.question
    assert question is not None
    assert question.message.startswith("/harmless commands robots.")
    acting.answer(is_allowed=False)
    session.tick()
    question = acting.question
    assert question is not None
    assert question.topic == "/arm/command"
    acting.answer(is_allowed=True)
    assert [sent.route.name for sent in sending.outbox.active_topics] == ["/a", "/arm/command"]
    assert acting.question is None
    session.tick()
    assert acting.question is None  # the denied question isn't repeated
    acting.deny(Target("topic", "/a"))
    session.tick()
    assert [sent.route.name for sent in sending.outbox.active_topics] == ["/arm/command"]
    for place in range(MAX_TARGETS + 5):
        sending.select("/a", None), sending.select("/a", f"/x{place}")
    assert len(sending.routes) == 3
    assert sending.arm() == ""
    assert acting.question is not None  # arming again repeats the denied question
    session.return_to_live()
    assert not acting.arming.is_on
    assert sending.outbox.active_topics == ()
    assert replay.sending is sending
