"""Tests of the measurements and the output of `nep topic hz`, `bw` and `delay`."""

from __future__ import annotations

import itertools
import json
import threading
import time

import pytest

import nep
from nep.cli.screen import print_status
from nep.cli.topics.hz_bw import _DelayReport, bw, format_duration, format_latency, hz
from nep.cli.topics.publish import repeat
from nep.cli.topics.rate_window import MAX_MESSAGES, Delay, LatchedFilter, LatencyWindow, RateWindow
from nep.errors import BadTopicError, WaitTimeoutError
from nep.messages.clocks import OWN_CLOCK, UNKNOWN_CLOCK
from nep.messages.message import message_kind
from nep.messages.message import received_message as new_arrived


def test_intervals_are_measured_with_the_publisher_clock():
    window = RateWindow(10.0)
    for number, stamp in enumerate((0.0, 0.1, 0.2, 0.4)):
        window.add(5.0 + number * 0.005, stamp, 10)  # messages arrive in one burst
    found = window.frequency(6.0)
    assert found.messages == 4
    assert found.rate_hz == pytest.approx(3 / 0.4)
    assert (found.min_s, found.max_s) == pytest.approx((0.1, 0.2))
    assert found.std_s == pytest.approx(0.0471, abs=1e-3)


def test_rate_uses_arrival_times_without_time_stamps_and_ignores_their_order():
    window = RateWindow(10.0)
    for arrived in (1.0, 2.0, 3.0):
        window.add(arrived, None, 10)
    assert window.frequency(3.0).rate_hz == pytest.approx(1.0)
    mixed = RateWindow(10.0)
    for stamp in (3.0, 1.0, 2.0):  # as from two publishers
        mixed.add(5.0, stamp, 10)
    assert mixed.frequency(5.0).rate_hz == pytest.approx(1.0)


def test_messages_older_than_the_window_are_not_counted():
    window = RateWindow(2.0)
    for arrived in range(10):
        window.add(float(arrived), None, 100)
    assert window.frequency(9.0).messages == 3
    assert window.total == 10
    assert window.frequency(100.0) is None
    assert window.bandwidth(100.0) is None


def test_bandwidth_and_message_sizes_are_measured():
    window = RateWindow(10.0)
    for arrived, size in ((0.0, 900), (1.0, 100), (2.0, 300)):
        window.add(arrived, None, size)
    found = window.bandwidth(2.0)
    assert (found.bandwidth_Bps, found.mean_bytes) == pytest.approx((200.0, 1300 / 3))
    assert (found.min_bytes, found.max_bytes, found.messages) == (100, 900, 3)


def test_single_message_has_no_rate_and_the_window_is_bounded():
    window = RateWindow(10.0)
    window.add(0.0, None, 1)
    assert (window.frequency(0.0), window.bandwidth(0.0)) == (None, None)
    for number in range(MAX_MESSAGES + 10):
        window.add(number * 1e-6, None, 1)
    assert window.frequency(0.2).messages == MAX_MESSAGES


def test_interval_is_formatted_with_a_suitable_unit():
    assert [format_duration(each) for each in (2.5, 0.0204, 0.000_31)] == ["2.5 s", "20.4 ms", "310 us"]


@pytest.fixture
def published(master):
    """Address of a master with two topics that are published 50 times a second."""
    end = threading.Event()
    with nep.node("talker") as node:
        pubs = [node.new_pub("/odom"), node.new_pub("words", "string")]

        def talk():
            while not end.wait(0.02):
                pubs[0].publish({"x": 1.0})
                pubs[1].publish("hello")

        thread = threading.Thread(target=talk)
        thread.start()
        yield master.address
        end.set()
        thread.join()


def test_hz_reports_each_topic_as_a_line_of_json(published, capfdbinary):
    hz(["/odom", "words"], 10.0, 1, published, as_json=True)
    lines = [json.loads(line) for line in capfdbinary.readouterr().out.splitlines()]
    assert [line["topic"] for line in lines] == ["/odom", "words"]
    for line in lines:
        assert 0 < line["rate_hz"] < 60
        assert line["min_s"] <= 1 / line["rate_hz"] <= line["max_s"]
        assert (line["lost"], line["messages"]) == (0, line["total"])


def test_bw_prints_sizes_as_a_table(published, capsys):
    bw(["words"], 10.0, 1, published, as_json=False)
    shown = capsys.readouterr()
    head, line = shown.out.splitlines()
    assert head.split()[:3] == ["topic", "bandwidth", "mean"]
    assert line.split()[0] == "words"
    assert line.split()[3:9] == ["5", "B", "5", "B", "5", "B"]
    assert "Ctrl+C" in shown.err


def test_missing_topic_is_awaited_and_the_nearest_name_is_suggested(published, capsys):
    with pytest.raises(WaitTimeoutError, match=r"timed out after 0\.5 s while waiting for .*'/odm'"):
        hz(["/odm"], 10.0, 0, published, timeout_s=0.5)
    assert "'/odm' has no publisher yet; did you mean '/odom'? waiting" in capsys.readouterr().err
    with pytest.raises(BadTopicError):
        bw(["bad topic"], 10.0, 1, published)


def test_topic_that_appears_later_is_measured(master, capsys, monkeypatch):
    ended = threading.Event()

    def publish_late(node):
        pub = node.new_pub("/odom")
        while not ended.wait(0.02):
            pub.publish({"x": 1})

    with nep.node("talker") as node:
        talking = threading.Thread(target=publish_late, args=(node,))

        def said(sentence):
            print_status(sentence)
            talking.start()

        monkeypatch.setattr("nep.cli.topics.topic_wait.print_status", said)
        hz(["/odom"], 60.0, 2, master.address)
        ended.set()
        talking.join()
    shown = capsys.readouterr()
    assert int(shown.out.splitlines()[-1].split()[-2]) > 1
    assert "'/odom' has no publisher yet; waiting" in shown.err


def test_delay_covers_only_messages_in_the_window():
    window = LatencyWindow(10.0)
    assert window.delay(0.0) is None
    window.add_latency(0.0, 99.0, 1)
    for arrived, age_s in ((20.0, 0.25), (21.0, -0.25), (22.0, None)):
        window.add_latency(arrived, age_s, 1)
    assert window.delay(25.0) == Delay(0.0, -0.25, 0.25, 0.25, 2)
    assert window.total == 4


def test_ages_from_before_the_clock_comparison_are_excluded():
    window = LatencyWindow(10.0)
    window.add_latency(1.0, 3600.0, 1)
    window.add_latency(2.0, 0.25, 1, 0.001)
    window.add_latency(3.0, 0.75, 1, 0.002)
    assert window.delay(3.0) == Delay(0.5, 0.25, 0.75, 0.25, 2, 0.002)
    window.add_latency(4.0, None, 1)
    window.add_latency(5.0, -3600.0, 1)
    assert window.delay(5.0) == Delay(-3600.0, -3600.0, -3600.0, 0.0, 1)
    assert window.total == 5


@pytest.mark.parametrize(
    ("age_s", "uncertainty_s", "words"),
    [
        (0.0032, 0.0004, "3.2 ms"),
        (-0.0001, 0.0004, "under 400 us"),
        (-0.0004, 0.0004, "under 400 us"),
        (-0.0005, 0.0004, "-500 us"),
        (-0.0005, 0.0, "-500 us"),
        (-3600.0, None, "-3.6e+03 s"),
        (0.0, 0.0004, "0 us"),
    ],
)
def test_negative_age_within_the_uncertainty_is_shown_as_less_than_the_uncertainty(
    age_s, uncertainty_s, words
):
    assert format_latency(age_s, uncertainty_s) == words


class _Told:
    """Delay report of one topic with the given latencies, without a master."""

    def __init__(self, *ages):
        self.report = _DelayReport(["t"], 10.0)
        self.report._subscribers["t"] = self
        for each in ages:
            self.report._latency_windows["t"].add_latency(time.monotonic(), each[0], 1, each[1])

    lost = 0


def test_delays_are_shown_with_their_uncertainty(capsys):
    _Told((0.0032, 0.0004)).report._show("t")
    assert capsys.readouterr().out.split()[1:6] == ["3.2", "ms", "±", "400", "us"]
    _Told((-0.0002, 0.0004)).report._show("t")
    assert capsys.readouterr().out.split()[1:4] == ["under", "400", "us"]
    _Told((0.0032, 0.0)).report._show("t")
    shown = capsys.readouterr()
    assert "±" not in shown.out
    assert "not compared" not in shown.err


def test_missing_clock_comparison_is_reported_once(capsys):
    report = _Told((3600.0, None)).report
    for _ in range(5):
        report._show("t")
    assert capsys.readouterr().err.count("clock difference between the two computers is unknown") == 1


def _latched(stamp_ns, clock=OWN_CLOCK, publisher=1):
    return new_arrived(
        message_kind("t", "json", "json", is_latched=True, clock=clock), b"1", stamp_ns, 1, publisher
    )


def test_latched_messages_from_before_the_subscription_are_detected():
    opened, now = time.monotonic(), time.time_ns()
    replays = LatchedFilter(opened)
    assert replays.predates_subscription(_latched(now - 10_000_000), opened)
    assert replays.predates_subscription(_latched(now - 5_000_000), opened)
    assert not replays.predates_subscription(_latched(now), opened + 1.0)
    assert not replays.predates_subscription(
        new_arrived(message_kind("t", "json", "json"), b"1", 0, 1, 1), opened
    )


def test_first_latched_message_predates_the_subscription_without_clock_comparison():
    replays = LatchedFilter(0.0)
    for publisher in (1, 2):
        first, second = (_latched(0, UNKNOWN_CLOCK, publisher) for _ in range(2))
        assert replays.predates_subscription(first, 5.0)
        assert not replays.predates_subscription(second, 5.0)


class _FakeClock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now

    def wait(self, seconds):
        self.now += seconds


def test_publish_loop_keeps_the_rate_and_skips_slots_missed_during_a_stall():
    clock, sent = _FakeClock(), []

    def send():
        sent.append(clock.now)
        clock.now += 0.23 if len(sent) == 5 else 0.004

    repeat(send, 50.0, 20, clock=clock, wait=clock.wait)
    gaps = [later - earlier for earlier, later in itertools.pairwise(sent)]
    assert gaps == pytest.approx([0.02] * 4 + [0.24] + [0.02] * 14)


def test_high_rate_is_kept_despite_late_wake_ups():
    clock, sent = _FakeClock(), []

    def oversleep(seconds):
        clock.now += seconds + 0.003 if seconds else 0.0

    repeat(lambda: sent.append(clock.now), 1000.0, 1000, clock=clock, wait=oversleep)
    assert sent[-1] - sent[0] == pytest.approx(0.999, abs=0.004)
