"""Tests of lanes, their marks and the selection of a timeline."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from app.core.timeline.lanes import Mark, TimelineContent, TimelineLane, spaced_marks
from app.core.timeline.selection import TimelineSelection

CONTENT = TimelineContent(lanes=tuple(TimelineLane(id, id.upper(), "type") for id in ("a", "b", "c")))
TIMES = st.integers(-1000, 2000)
MARKS = st.lists(st.tuples(TIMES, st.integers(0, 400)), max_size=50).map(
    lambda pairs: [Mark(start, start + length, "") for start, length in sorted(pairs)]
)


def test_neighbour_is_limited_to_the_first_and_the_last_lane():
    assert [CONTENT.neighbour("b", by) for by in (-1, 1, -9, 9, 0)] == ["a", "c", "a", "c", "b"]
    assert CONTENT.neighbour("gone", 1) == "b"
    assert TimelineContent().neighbour("a", 1) == ""
    assert CONTENT.index_of("gone") is None


@given(MARKS, st.floats(0.01, 10), st.floats(0, 8))
def test_painted_marks_are_visible_and_end_beyond_the_previous_one(marks, pixels_per_ns, min_width):
    painted = list(spaced_marks(marks, lambda at_ns: at_ns * pixels_per_ns, 0.0, 1000.0, min_width))
    free_x = -1.0
    for mark in painted:
        start_x, end_x = mark.start_ns * pixels_per_ns, mark.end_ns * pixels_per_ns
        assert start_x <= 1001.0
        assert end_x >= -1.0
        assert max(end_x, start_x + min_width) >= free_x
        free_x = max(end_x, start_x + min_width) + 1
    visible = [mark for mark in marks if mark.start_ns * pixels_per_ns <= 1000 and mark.end_ns >= 0]
    assert painted or not visible


def test_thousands_of_marks_in_one_pixel_are_painted_once():
    marks = [Mark(number, number, "") for number in range(5000)]
    assert len(list(spaced_marks(marks, lambda at_ns: at_ns / 5000, 0.0, 100.0, 3.0))) == 1


def test_an_edge_of_the_range_moves_but_the_range_is_never_empty():
    selection = TimelineSelection(5, (10, 20))
    assert selection.resized_range("start", 12) == (12, 20)
    assert selection.resized_range("end", 12) == (10, 12)
    assert selection.resized_range("start", 20) is None
    assert selection.resized_range("end", 3) is None
    assert TimelineSelection(5).resized_range("end", 3) is None
