"""Tests of playback: message order and times at any speed, seeking, stepping and loops."""

from __future__ import annotations

import threading

import pytest

from nep.recordings.player import Playback, Player
from nep.recordings.reader import Recording
from tests.nep.programs import eventually as until
from tests.nep.recordings.messages import STEP_NS, json_message, kept, record

COUNT = 100
STEP_S = STEP_NS / 1e9


class Clock:
    """Fake clock that the test advances; times in seconds."""

    def __init__(self) -> None:
        self.now = 50.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("recordings") / "a.mcap"
    topics = ("/a", "/b")
    messages = [json_message(seq, topic=topics[seq % 2]) for seq in range(COUNT)]
    record(path, [messages[:30], messages[30:60], messages[60:]])
    return path


@pytest.fixture
def recording(path):
    with Recording(path) as opened:
        yield opened


@pytest.fixture
def times(recording):
    return {each.message.seq: each.log_ns for each in recording.read()}


def run(playback: Playback, clock: Clock, seconds: float, step_s: float = 0.004) -> list[tuple[float, int]]:
    """Advance the clock and return (seconds since the start, seq) of each message that was played."""
    found, started = [], clock.now
    while clock.now < started + seconds - 1e-9:
        due = playback.advance()
        if not due.is_jump:
            found += [(clock.now - started, each.seq) for each in due.messages]
        clock.now += step_s
    return found


def jumped(playback: Playback) -> dict[str, int]:
    due = playback.advance()
    assert due.is_jump
    return {each.topic: each.seq for each in due.messages}


@pytest.mark.parametrize("speed", [0.1, 0.5, 1.0, 3.0, 10.0])
def test_playback_delivers_each_message_at_its_time_for_any_speed(recording, times, speed):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    playback.speed = speed
    playback.play()
    found = run(playback, clock, 1.2 * COUNT * STEP_S / speed)
    assert [seq for _at, seq in found] == list(range(COUNT))
    for at, seq in found:
        due_s = (times[seq] - recording.start_ns) / 1e9 / speed
        assert -1e-6 <= at - due_s <= 0.0041
    status = playback.status()
    assert (status.is_playing, status.is_at_end, status.position_ns) == (False, True, recording.end_ns)
    assert playback.advance().wait_s is None


def test_playback_waits_until_the_next_message_and_at_most_50_ms(recording):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    playback.play()
    count = 0
    for _each in range(10_000):
        due = playback.advance()
        count += len(due.messages)
        if due.wait_s is None:
            break
        assert 0.0 <= due.wait_s <= 0.05
        clock.now += due.wait_s + 1e-6
    assert count == COUNT


def test_seek_returns_newest_message_of_each_topic_and_playback_continues_after_seek(recording, times):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    playback.seek(times[50])
    assert jumped(playback) == {"/a": 50, "/b": 49}
    assert playback.advance().messages == ()
    playback.play()
    assert run(playback, clock, 0.1)[0][1] == 51
    playback.seek(times[10] - 1)
    assert jumped(playback) == {"/a": 8, "/b": 9}
    assert run(playback, clock, 0.1)[0][1] == 10
    for at_ns in (-(2**70), 2**70):
        playback.seek(at_ns)
        assert recording.start_ns <= playback.status().position_ns <= recording.end_ns


def test_step_moves_between_messages_of_a_topic(recording, times):
    playback = Playback(recording, clock=Clock())
    playback.seek(times[50])
    jumped(playback)
    for forward, seq in ((True, 52), (True, 54), (False, 52), (False, 50), (False, 48)):
        assert playback.step("/a", forward=forward)
        assert jumped(playback)["/a"] == seq
        assert playback.status().position_ns == times[seq]
    playback.play()
    assert not playback.step("/nothing")
    assert not playback.status().is_playing
    playback.seek(recording.end_ns)
    assert not playback.step("/a")


def test_loop_repeats_its_range_until_disabled(recording, times):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    playback.loop(times[20], times[24])
    playback.play()
    found = [seq for _at, seq in run(playback, clock, 0.5)]
    assert found[:9] == [21, 22, 23, 24, 20, 21, 22, 23, 24]
    playback.clear_loop()
    found = [seq for _at, seq in run(playback, clock, 2.0)]
    assert found[-1] == COUNT - 1
    assert playback.status().is_at_end
    playback.loop()
    playback.play()
    found = [seq for _at, seq in run(playback, clock, 3.0)]
    assert found[: 2 * COUNT] == [*range(COUNT), *range(COUNT)]  # including the first message of each pass
    for part in ((5, 5), (times[9], times[3])):
        with pytest.raises(ValueError, match="within the recording"):
            playback.loop(*part)


def test_play_at_the_end_restarts_from_the_beginning(recording):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    for _each in range(2):
        playback.play()
        assert [seq for _at, seq in run(playback, clock, 1.5)] == list(range(COUNT))


def test_slow_consumer_receives_all_messages_and_the_actual_speed_is_reported(recording):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    playback.speed = 10.0
    playback.play()
    found = []
    while playback.status().is_playing:
        due = playback.advance()
        found += [each.seq for each in due.messages]
        assert len(due.messages) <= 10 * 0.25 / STEP_S + 1
        clock.now += 1.0  # displaying the messages takes a second
    assert found == list(range(COUNT))
    playback = Playback(recording, clock=clock)
    playback.speed = 0.4
    playback.play()
    run(playback, clock, 0.3)
    assert playback.status().measured_speed == pytest.approx(0.4, rel=0.05)
    for _each in range(3):
        playback.advance()
        clock.now += 0.5
    playback.advance()
    assert playback.status().measured_speed == pytest.approx(0.2, rel=0.3)  # a step covers at most 0.25 s


def test_pause_keeps_the_position_and_invalid_speeds_are_rejected(recording):
    clock = Clock()
    playback = Playback(recording, clock=clock)
    playback.play()
    run(playback, clock, 0.2)
    playback.pause()
    place = playback.status().position_ns
    clock.now += 100.0
    assert playback.advance().messages == ()
    playback.play()
    assert run(playback, clock, 0.02)[-1][1] < 30
    assert playback.status().position_ns >= place
    for wrong in (0.0, -1.0, 0.09, 10.1, float("nan"), float("inf")):
        with pytest.raises(ValueError, match=r"0\.1 to 10"):
            playback.speed = wrong


def test_played_topics_are_filtered_and_remapped(recording):
    clock = Clock()
    playback = Playback(recording, clock=clock, topics=("/a",), remap={"/a": "/test/a"})
    playback.play()
    found = []
    while playback.status().is_playing:
        found += playback.advance().messages
        clock.now += 0.01
    assert {each.topic for each in found} == {"/test/a"}
    assert [(each.seq, bytes(each.data)) for each in found] == [
        (seq, bytes(json_message(seq).data)) for seq in range(0, COUNT, 2)
    ]


def test_playback_of_an_empty_recording_delivers_no_message(tmp_path):
    record(tmp_path / "a.mcap", [])
    with Recording(tmp_path / "a.mcap") as recording:
        playback = Playback(recording, clock=Clock())
        playback.play()
        playback.loop()
        assert not playback.advance().messages
        playback.seek(5)
        playback.advance()
        playback.play()
        playback.advance()


def test_player_thread_delivers_messages_in_order_and_reports_seeks_separately(recording, times):
    came, jumps, ended = [], [], threading.Event()
    playback = Playback(recording)
    with Player(playback, came.extend, on_jump=jumps.append, on_end=ended.set) as player:
        player.apply(lambda each: setattr(each, "speed", 10.0))
        player.apply(Playback.play)
        assert ended.wait(30)
        assert [kept(each) for each in came] == [kept(each.message) for each in recording.read()]
        assert not jumps
        player.apply(lambda each: each.seek(times[50]))
        until(lambda: jumps)
        assert {each.seq for each in jumps[0]} == {49, 50}
        with pytest.raises(ValueError, match=r"0\.1 to 10"):
            player.apply(lambda each: setattr(each, "speed", 0.0))
        assert player.status.position_ns == times[50]
    player.close()


def test_exception_of_the_sink_ends_playback_and_is_reported(recording):
    ended = threading.Event()

    def refuse(_messages):
        raise ConnectionError("nobody is there")

    with Player(Playback(recording), refuse, on_end=ended.set) as player:
        player.apply(Playback.play)
        assert ended.wait(30)
        assert str(player.problem) == "nobody is there"
        assert not player.status.is_playing
