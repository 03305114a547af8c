"""Tests of curves: every message is a point at its own time, missing values are gaps."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.network.mailbox import Batch
from app.core.series.csv_export import columns_of, csv_chunks
from app.core.series.curves import Curve, Curves
from app.core.series.feed import SeriesFeed
from app.core.series.field_path import MISSING, FieldPath
from app.errors import CurveError
from nep.messages.message import Message

ORIGIN = 1_795_000_000 * 10**9


class Watching:
    """Fake watch that records its topic while it is open."""

    def __init__(self, topic: str, open_ones: list[str]) -> None:
        self.topic, self.open_ones = topic, open_ones
        open_ones.append(topic)

    def suspend(self) -> None:
        raise AssertionError("a plot never rests")

    resume = suspend

    def close(self) -> None:
        self.open_ones.remove(self.topic)


class Case:
    """Plot with a feed; `send` delivers messages in one tick."""

    def __init__(self) -> None:
        self.watched: list[str] = []
        self.topics = ["/a", "/b"]
        self.feed = SeriesFeed(lambda topic: Watching(topic, self.watched), lambda: ORIGIN)
        self.curves = Curves(self.feed, lambda: self.topics)
        self.seqs: dict[str, int] = {}

    def curve(self, text: str) -> Curve:
        (made,) = self.curves.add(text)
        return made

    def send(self, topic: str, *rows: tuple[float, object], dropped: int = 0, skip: int = 0) -> None:
        messages = []
        self.seqs[topic] = self.seqs.get(topic, 0) + dropped + skip
        for time_s, payload in rows:
            self.seqs[topic] += 1
            data = payload if isinstance(payload, bytes) else json.dumps(payload).encode()
            stamp_ns = ORIGIN + round(time_s * 1e9)
            messages.append(
                Message(topic, data, "json", "json", stamp_ns=stamp_ns, seq=self.seqs[topic], publisher=1)
            )
        self.feed.dispatch({topic: Batch(messages, dropped)})
        self.curves.advance()


def points(curve: Curve) -> list[tuple[float, float, bool]]:
    samples = curve.samples
    return list(
        zip(samples.times.round(6).tolist(), samples.values.tolist(), samples.gaps.tolist(), strict=True)
    )


def test_every_message_is_a_point_at_its_own_time() -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", *((n / 1000, {"x": n}) for n in range(30)))
    case.send("/a", *((n / 1000, {"x": n}) for n in range(30, 60)))
    assert points(x) == [(n / 1000, float(n), False) for n in range(60)]
    assert case.curves.lost == 0


@pytest.mark.parametrize("how", [{"dropped": 5}, {"skip": 5}])
def test_lost_messages_leave_a_gap_and_are_counted(how) -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", (0.0, {"x": 1}), (0.1, {"x": 2}))
    case.send("/a", (0.7, {"x": 3}), (0.8, {"x": 4}), **how)
    assert [gap for _t, _v, gap in points(x)] == [False, False, True, False]
    assert case.curves.lost == 5


@pytest.mark.parametrize(
    "missing", [b"{", {"y": 1}, {"x": None}, {"x": [1]}, b'{"x": NaN}', {"x": {"deep": 1}}]
)
def test_message_without_the_plotted_number_is_a_gap(missing) -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", (0.0, {"x": 1}), (0.1, missing), (0.2, {"x": 3}))
    case.send("/a", (0.3, missing))
    case.send("/a", (0.4, {"x": 4}))
    assert points(x) == [(0.0, 1, False), (0.2, 3, True), (0.4, 4, True)]


def test_long_silence_is_a_gap_and_short_silence_is_not() -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", *((n / 10, {"x": n}) for n in range(20)))
    case.send("/a", (2.8, {"x": 0}), (9.0, {"x": 1}), (9.1, {"x": 2}))
    assert [t for t, _v, gap in points(x) if gap] == [9.0]


def test_topic_with_a_lower_rate_becomes_a_continuous_line_again() -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", *((n / 1000, {"x": n}) for n in range(50)))
    case.send("/a", *((float(n), {"x": n}) for n in range(5, 60, 5)))
    assert [t for t, _v, gap in points(x) if gap] == [5.0, 10.0], "not each of them is after a gap"


@pytest.mark.parametrize(("dropped", "skip", "lost"), [(5, 0, 5), (5, 3, 8), (0, 3, 3)])
def test_lost_messages_are_counted_once(dropped, skip, lost) -> None:
    case = Case()
    case.curve("/a.x")
    case.send("/a", (0.0, {"x": 1}))
    case.send("/a", (0.1, {"x": 2}), dropped=dropped, skip=skip)
    assert case.curves.lost == lost


def test_losses_after_message_with_invalid_time_are_counted() -> None:
    case = Case()
    case.curve("/a.x")
    seqs = ((1, ORIGIN), (2, 2**64 - 1), (5, ORIGIN + 10**8), (5 + 4, ORIGIN + 2 * 10**8))
    made = [Message("/a", b'{"x": 2}', "json", "json", stamp_ns=s, seq=n, publisher=1) for n, s in seqs]
    case.feed.dispatch({"/a": Batch(made)})
    assert (case.curves.lost, case.curves.skipped_count) == (2 + 3, 1)


def test_plotted_value_can_change_between_number_and_state() -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send(
        "/a", (0.0, {"x": 1}), (0.1, {"x": "up"}), (0.2, {"x": "up"}), (0.3, {"x": 2}), (0.4, {"x": True})
    )
    assert points(x) == [(0.0, 1, False), (0.3, 2, True)]
    assert x.states is not None
    runs = [(run.start_s, run.end_s, run.value) for run in x.states.runs(0, 9)]
    assert runs == [(0.1, 0.3, "up"), (0.3, 0.4, None), (0.4, 0.4, "true")]
    assert x.is_state
    assert x.last is True
    case.send("/a", (0.5, {"x": 5}))
    assert not x.is_state


def test_extreme_numbers_are_kept() -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", (0.0, {"x": 2**64 - 1}), (0.1, {"x": 1e308}), (0.2, {"x": 0}))
    assert [v for _t, v, _g in points(x)] == [float(2**64 - 1), 1e308, 0.0]
    assert x.last == 0


@pytest.mark.parametrize("stamp_ns", [2**64 - 1, 2**63, -1])
def test_message_with_invalid_time_stamp_is_skipped(stamp_ns) -> None:
    case = Case()
    x = case.curve("/a.x")
    case.send("/a", (0.0, {"x": 1}))
    bad = Message("/a", b'{"x": 2}', "json", "json", stamp_ns=stamp_ns, seq=2, publisher=1)
    case.feed.dispatch({"/a": Batch([bad])})
    case.seqs["/a"] = 2
    case.send("/a", (0.2, {"x": 3}))
    assert points(x) == [(0.0, 1, False), (0.2, 3, True)]


def test_message_without_time_stamp_uses_arrival_time() -> None:
    case = Case()
    x = case.curve("/a.x")
    case.feed.dispatch({"/a": Batch([Message("/a", b'{"x": 2}', "json", "json")])})
    assert points(x) == [(0.0, 2, False)]


values_of_all_kinds = st.one_of(
    st.integers(-(2**64), 2**64),
    st.floats(),
    st.none(),
    st.booleans(),
    st.text(max_size=3),
    st.just([]),
    st.just({}),
)
steps = st.sampled_from([0.01, 0.5, -0.3, -20.0, 1e6])


@settings(max_examples=15, deadline=None)
@given(st.lists(st.tuples(steps, values_of_all_kinds), max_size=40))
def test_curves_stay_sorted_and_finite_for_any_input(rows) -> None:
    case = Case()
    made = [
        case.curve(t)
        for t in ("/a.x", "derivative(/a.x)", "integral(/a.x)", "mean(/a.x, 1 s)", "/a.x * 2 - /a.x")
    ]
    time_s = 100.0
    for number, (step, value) in enumerate(rows):
        time_s = max(0.0, time_s + step)
        case.send("/a", (time_s, {"x": value}), dropped=number % 7 == 6)
    for curve in made:
        assert bool(np.all(np.diff(curve.samples.times) >= 0))
        assert bool(np.all(np.isfinite(curve.samples.values)))
        assert "".join(csv_chunks(columns_of([curve]), ORIGIN)).count("\r\n") >= 1
    assert points(made[4]) == points(made[0]) or any(
        isinstance(v, (int, float)) and not isinstance(v, bool) and abs(v) > 1e300 for _s, v in rows
    )


# -- calculated curves --------------------------------------------------------------------------------


def test_calculated_curves_have_correct_values() -> None:
    case = Case()
    names = ("difference(/a.x)", "derivative(/a.x)", "integral(/a.x)", "mean(/a.x, 0.25 s)", "/a.x * 10")
    difference, derivative, integral, mean, times = (case.curve(name) for name in names)
    rows = [(0.0, 0), (0.1, 1), (0.2, 3), (0.3, 6)]
    for row in rows:  # one row per tick; batching must not matter
        case.send("/a", (row[0], {"x": row[1]}))
    assert points(difference) == [(0.1, 1, False), (0.2, 2, False), (0.3, 3, False)]
    assert [v for _t, v, _g in points(derivative)] == pytest.approx([10, 20, 30])
    assert [v for _t, v, _g in points(integral)] == pytest.approx([0, 0.05, 0.25, 0.7])
    assert [v for _t, v, _g in points(mean)] == pytest.approx([0, 0.5, 4 / 3, 10 / 3])
    assert [v for _t, v, _g in points(times)] == [0, 10, 30, 60]


def test_calculations_do_not_span_gaps() -> None:
    case = Case()
    difference, integral = case.curve("difference(/a.x)"), case.curve("integral(/a.x)")
    case.send("/a", (0.0, {"x": 1}), (1.0, {"x": 1}))
    case.send("/a", (2.0, {"x": 100}), (3.0, {"x": 101}), dropped=3)
    assert points(difference) == [(1.0, 0, False), (3.0, 1, True)]
    assert [v for _t, v, _g in points(integral)] == pytest.approx([0, 1, 1, 101.5])


def test_overflow_is_a_gap_without_warning() -> None:
    case = Case()
    made = [case.curve(f"{kind}(/a.x)") for kind in ("integral", "derivative", "difference")]
    case.send("/a", *((n / 10, {"x": value}) for n, value in enumerate([1.7e308, 1.7e308, -1.7e308, 1, 2])))
    for curve in made:
        assert bool(np.all(np.isfinite(curve.samples.values)))
    assert [v for _t, v, _g in points(made[2])][-1] == 1


def batch_wise(
    calculate: Callable[[list[float]], list[float]], text: str, values: list[float], cuts: list[int]
) -> None:
    case = Case()
    curve = case.curve(text)
    rows = [(n / 10, {"x": value}) for n, value in enumerate(values)]
    for begin, end in zip([0, *cuts], [*cuts, len(rows)], strict=True):
        case.send("/a", *rows[begin:end])
    assert curve.samples.values.tolist() == pytest.approx(calculate(values), rel=1e-9, abs=1e-9)


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60), st.lists(st.integers(0, 60), max_size=6))
def test_batch_boundaries_do_not_change_calculated_curves(values, cuts) -> None:
    cuts = sorted(min(each, len(values)) for each in cuts)
    batch_wise(lambda v: list(np.diff(v)), "difference(/a.x)", values, cuts)
    batch_wise(
        lambda v: [float(np.mean(v[max(0, n - 4) : n + 1])) for n in range(len(v))],
        "mean(/a.x, 0.45 s)",
        values,
        cuts,
    )
    batch_wise(
        lambda v: [0.0, *np.cumsum([(a + b) / 20 for a, b in pairwise(v)])],
        "integral(/a.x)",
        values,
        cuts,
    )


def test_two_topics_are_joined_at_times_of_the_first() -> None:
    case = Case()
    curve = case.curve("/a.x - /b.y")
    case.send("/a", (0.1, {"x": 10}), (0.2, {"x": 20}))
    assert points(curve) == [], "the other may still tell"
    case.send("/b", (0.05, {"y": 1}), (0.15, {"y": 2}), (0.3, {"y": 3}))
    assert points(curve) == [(0.1, 9, False), (0.2, 18, False)]
    case.send("/a", (0.25, {"x": 0}), (0.9, {"x": 5}))
    assert points(curve)[2:] == [(0.25, -2, False)]
    case.send("/a", (1.5, {"x": 7}))
    assert points(curve)[3:] == [(0.9, 2, False)], "it does not wait for ever"


def test_calculated_curves_follow_a_clock_set_back() -> None:
    case = Case()
    x, doubled, mean = (case.curve(t) for t in ("/a.x", "/a.x * 2", "mean(/a.x, 1 s)"))
    case.send("/a", *((float(n), {"x": n}) for n in range(50)))
    case.send("/a", (10.5, {"x": -1}))
    case.send("/a", (11.0, {"x": -3}))
    assert points(x)[-2:] == [(10.5, -1, True), (11.0, -3, False)]
    assert [t for t, _v, _g in points(doubled)] == [t for t, _v, _g in points(x)]
    assert points(doubled)[-1] == (11.0, -6, False)
    assert points(mean)[-1][1] == -2


# -- curves of the plot -----------------------------------------------------------------------------------


def test_topic_is_watched_while_a_curve_needs_it() -> None:
    case = Case()
    one, two = case.curve("/a.x"), case.curve("mean(/a.x - /b.y, 2 s)")
    assert sorted(case.watched) == ["/a", "/b"]
    case.curves.remove(one)
    assert sorted(case.watched) == ["/a", "/b"]
    case.curves.remove(two)
    assert case.watched == []


def test_every_list_element_is_a_separate_curve() -> None:
    case = Case()
    case.curve("/a.n")
    case.send("/a", (0.0, {"n": 1, "j": [{"p": 1}, {"p": 2}, {"p": 3}]}))
    brought = case.curves.add("/a.j[*].p")
    assert [each.samples.values.tolist() for each in brought] == [[1], [2], [3]], "of the newest message, too"
    assert [each.text for each in brought] == [f"/a.j[{n}].p" for n in range(3)]
    assert case.curves.add("/a.j[*].p") == [], "they are there"
    with pytest.raises(CurveError, match="has no elements now"):
        case.curves.add("/a.n[*]")


def test_misspelled_field_is_reported_with_suggestion() -> None:
    case = Case()
    sped = case.curve("/a.sped")
    assert case.curves.no_values_reason(sped) == ""
    case.send("/a", (0.0, {"speed": 1, "pose": {"x": 1}}))
    assert case.curves.no_values_reason(sped) == "/a.sped doesn't exist. Did you mean /a.speed?"
    assert "Choose one" in case.curves.no_values_reason(case.curve("/a.pose"))
    with pytest.raises(CurveError, match="did you mean /a"):
        case.curves.add("/aa.x")


def test_number_of_curves_is_limited() -> None:
    case = Case()
    for number in range(64):
        case.curve(f"/a.x{number}")
    with pytest.raises(CurveError, match="64"):
        case.curve("/a.one_more")
    many = Case()
    many.curve("/a.n")
    many.send("/a", (0.0, {"n": 1, "all": list(range(65))}))
    with pytest.raises(CurveError, match="64"):
        many.curves.add("/a.all[*]")
    assert len(many.curves.all) == 1, "not the first 64 of them, as if there were no more"
    assert sum(curve.samples.limit for curve in case.curves.all) <= 8 << 20


def test_topic_that_does_not_exist_yet_can_be_plotted() -> None:
    case = Case()
    (curve,) = case.curves.add_field("/later", FieldPath.parse("x"))
    assert case.watched == ["/later"]
    assert curve.last is MISSING
    case.send("/later", (0.0, {"x": 1}))
    assert points(curve) == [(0.0, 1, False)]


def test_csv_has_a_row_per_time_and_escapes_formulas() -> None:
    case = Case()
    case.topics.append("ros2 /a")
    made = [case.curve(text) for text in ("/a.x", "/a.word", "/b.y")]
    case.send("/a", (0.0, {"x": 1.5, "word": "=1+1"}), (0.5, {"x": 2, "word": "=1+1"}))
    case.send("/b", (0.5, {"y": -1}), (0.75, {"y": 1e-9}))
    rows = list(csv.reader("".join(csv_chunks(columns_of(made), ORIGIN)).splitlines()))
    assert rows[0] == ["stamp_ns", "time_utc", "/a.x", "/a.word", "/b.y"]
    assert [row[2:] for row in rows[1:]] == [["1.5", "'=1+1", ""], ["2.0", "", "-1.0"], ["", "", "1e-09"]]
    assert rows[1][0] == str(ORIGIN)
    assert rows[2][1].endswith(".500000000Z")
    assert math.isclose(int(rows[3][0]) - ORIGIN, 0.75e9)
    assert len("".join(csv_chunks(columns_of(made, 0.6, 0.8), ORIGIN)).splitlines()) == 2


@pytest.mark.parametrize("rows_at_once", [1, 3, 5000])
def test_csv_written_in_parts_equals_csv_written_at_once(monkeypatch, rows_at_once) -> None:
    case = Case()
    made = [case.curve(text) for text in ("/a.x", "/a.word", "/b.y")]
    case.send("/a", *((n / 10, {"x": n, "word": "up" if n % 4 < 2 else "down"}) for n in range(20)))
    case.send("/b", *((n / 7, {"y": -n}) for n in range(14)))
    whole = "".join(csv_chunks(columns_of(made), ORIGIN))
    monkeypatch.setattr("app.core.series.csv_export.ROWS_PER_CHUNK", rows_at_once)
    parts = list(csv_chunks(columns_of(made), ORIGIN))
    assert "".join(parts) == whole
    assert len(whole.splitlines()) == 1 + len({*(n / 10 for n in range(20)), *(n / 7 for n in range(14))})
    assert len(parts) == 1 + -(-(len(whole.splitlines()) - 1) // rows_at_once)
