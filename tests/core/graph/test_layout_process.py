from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from app.core.graph import layout_process, layout_thread
from app.core.graph.layout import LayoutSizes, arrange
from app.core.graph.layout_process import MAX_HERE, LayoutProcess, is_large
from app.core.graph.layout_thread import LayoutThread
from app.core.graph.node_graph import DrawnNode, GraphLine, NodeGraph
from app.core.network.nodes import NodeEntry
from tests.nep.programs import eventually

KEYS = [f"n{number}" for number in range(MAX_HERE + 1)]
LARGE = NodeGraph(
    tuple(DrawnNode(key, key, "", "program", NodeEntry(key, key)) for key in KEYS),
    tuple(GraphLine("topic", (a,), (b,), (f"/{a}",)) for a, b in zip(KEYS[::3], KEYS[1::3], strict=False)),
)


def test_large_is_what_takes_longer_than_a_process_needs_to_start() -> None:
    assert is_large(LARGE)
    assert not is_large(replace(LARGE, nodes=LARGE.nodes[1:]))
    assert is_large(NodeGraph(lines=(GraphLine("topic", tuple(KEYS[:8]), tuple(KEYS[:8]), ("/all",)),)))
    assert not is_large(NodeGraph())


def test_a_process_finds_the_same_places() -> None:
    made = LayoutProcess().arrange(LARGE, None, LayoutSizes())
    assert made == arrange(LARGE)


def test_a_process_that_was_ended_gives_nothing() -> None:
    process = LayoutProcess()
    process.kill()
    assert process.arrange(LARGE, None, LayoutSizes()) is None


def test_one_that_takes_too_long_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout_process, "TIMEOUT_S", 0.0)
    assert LayoutProcess().arrange(LARGE, None, LayoutSizes()) is None


def test_the_thread_places_in_rows_what_no_process_could_place(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def arrange(self, *_arguments: object) -> None:
            return None

    monkeypatch.setattr(layout_thread, "LayoutProcess", Broken)
    thread = LayoutThread()
    thread.ask(LARGE, None, LayoutSizes())
    eventually(lambda: not thread.is_busy)
    made = thread.pop_result()
    thread.close()
    assert made is not None
    assert made[1].is_plain
    assert made[1].places.keys() == {*KEYS}


def test_closing_ends_a_process_that_is_at_work(monkeypatch: pytest.MonkeyPatch) -> None:
    works, ended = threading.Event(), threading.Event()

    class Endless:
        def arrange(self, *_arguments: object) -> None:
            works.set()
            assert ended.wait(20)

        def kill(self) -> None:
            ended.set()

    monkeypatch.setattr(layout_thread, "LayoutProcess", Endless)
    thread = LayoutThread()
    thread.ask(LARGE, None, LayoutSizes())
    assert works.wait(20)
    thread.close()
    assert ended.is_set()
    assert "graph-layout" not in {each.name for each in threading.enumerate()}
