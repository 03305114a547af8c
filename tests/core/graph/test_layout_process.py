from __future__ import annotations

import threading
from dataclasses import replace

import pytest

from app.core.graph import layout_process, layout_thread
from app.core.graph.layout import LayoutSizes, arrange
from app.core.graph.layout_process import MAX_INLINE_NODES, LayoutProcess, is_large
from app.core.graph.layout_thread import LayoutThread
from app.core.graph.node_graph import DrawnNode, GraphLine, NodeGraph
from app.core.network.nodes import NodeEntry
from tests.nep.programs import eventually

KEYS = [f"n{number}" for number in range(MAX_INLINE_NODES + 1)]
LARGE = NodeGraph(
    tuple(DrawnNode(key, key, "", "program", NodeEntry(key, key)) for key in KEYS),
    tuple(GraphLine("topic", (a,), (b,), (f"/{a}",)) for a, b in zip(KEYS[::3], KEYS[1::3], strict=False)),
)


def test_graph_size_decides_whether_layout_runs_in_a_process() -> None:
    assert is_large(LARGE)
    assert not is_large(replace(LARGE, nodes=LARGE.nodes[1:]))
    assert is_large(NodeGraph(lines=(GraphLine("topic", tuple(KEYS[:8]), tuple(KEYS[:8]), ("/all",)),)))
    assert not is_large(NodeGraph())


def test_layout_process_returns_the_same_layout_as_the_calling_process() -> None:
    made = LayoutProcess().arrange(LARGE, None, LayoutSizes())
    assert made == arrange(LARGE)


def test_killed_layout_process_returns_none() -> None:
    process = LayoutProcess()
    process.kill()
    assert process.arrange(LARGE, None, LayoutSizes()) is None


def test_layout_process_times_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(layout_process, "TIMEOUT_S", 0.0)
    assert LayoutProcess().arrange(LARGE, None, LayoutSizes()) is None


def test_layout_thread_falls_back_to_rows_when_process_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    class Broken:
        def arrange(self, *_arguments: object) -> None:
            return None

    monkeypatch.setattr(layout_thread, "LayoutProcess", Broken)
    thread = LayoutThread()
    thread.submit(LARGE, None, LayoutSizes())
    eventually(lambda: not thread.is_busy)
    made = thread.pop_result()
    thread.close()
    assert made is not None
    assert made[1].is_fallback
    assert made[1].positions.keys() == {*KEYS}


def test_close_kills_running_layout_process(monkeypatch: pytest.MonkeyPatch) -> None:
    works, ended = threading.Event(), threading.Event()

    class Endless:
        def arrange(self, *_arguments: object) -> None:
            works.set()
            assert ended.wait(20)

        def kill(self) -> None:
            ended.set()

    monkeypatch.setattr(layout_thread, "LayoutProcess", Endless)
    thread = LayoutThread()
    thread.submit(LARGE, None, LayoutSizes())
    assert works.wait(20)
    thread.close()
    assert ended.is_set()
    assert "graph-layout" not in {each.name for each in threading.enumerate()}
