"""Background thread that computes the layout of the newest graph."""

from __future__ import annotations

import threading
from collections.abc import Callable

from app.core.faults import log_errors
from app.core.graph.layout import GraphLayout, LayoutSizes, arrange, arrange_in_rows
from app.core.graph.layout_process import LayoutProcess, is_large
from app.core.graph.node_graph import NodeGraph

JOIN_TIMEOUT_S = 5.0

Arrange = Callable[[NodeGraph, "GraphLayout | None", LayoutSizes], GraphLayout]


class LayoutThread:
    """Background thread that computes layouts. A newer graph replaces a pending one.

    The first graph starts the thread. Large graphs are passed to a child process (see
    `layout_process`).
    """

    def __init__(self, arrange_function: Arrange | None = None) -> None:
        # `arrange_function` replaces the layout function, for graphs of any size.
        self._arrange = arrange_function if arrange_function is not None else self._arrange_by_size
        self._process: LayoutProcess | None = None
        self._changed = threading.Condition()
        self._pending_request: tuple[NodeGraph, GraphLayout | None, LayoutSizes] | None = None
        self._result: tuple[NodeGraph, GraphLayout] | None = None
        self._is_busy = self._is_closing = False
        self._thread: threading.Thread | None = None

    @property
    def is_busy(self) -> bool:
        """True if a graph is being laid out or pending."""
        with self._changed:
            return self._is_busy or self._pending_request is not None

    def submit(self, graph: NodeGraph, previous: GraphLayout | None, sizes: LayoutSizes) -> None:
        """Request the layout of a graph, replacing a pending request. Does nothing after `close`.

        Args:
            graph: Drawing to lay out.
            previous: Previous layout, or None.
            sizes: Sizes of boxes and margins.
        """
        with self._changed:
            if self._is_closing:
                return
            self._pending_request = graph, previous, sizes
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, name="graph-layout", daemon=True)
                self._thread.start()
            self._changed.notify()

    def pop_result(self) -> tuple[NodeGraph, GraphLayout] | None:
        """Return and clear the newest finished graph and its layout; None if there is none."""
        with self._changed:
            layout, self._result = self._result, None
            return layout

    def close(self) -> None:
        """Stop the thread. Waits at most `JOIN_TIMEOUT_S` seconds, in case graphlay hangs."""
        with self._changed:
            self._is_closing, self._pending_request = True, None
            self._changed.notify()
            if self._process is not None:
                self._process.kill()
        if self._thread is not None:
            self._thread.join(JOIN_TIMEOUT_S)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._pending_request is not None or self._is_closing)
                if self._is_closing or self._pending_request is None:
                    return
                graph, previous, sizes = self._pending_request
                self._pending_request, self._is_busy = None, True
            layout: GraphLayout | None = None
            with log_errors("lay out the graph"):
                layout = self._arrange(graph, previous, sizes)
            with self._changed:
                self._is_busy = False
                if layout is not None:
                    self._result = graph, layout

    def _arrange_by_size(
        self, graph: NodeGraph, previous: GraphLayout | None, sizes: LayoutSizes
    ) -> GraphLayout:
        if not is_large(graph):
            return arrange(graph, previous, sizes)
        with self._changed:
            if self._is_closing:
                return GraphLayout()
            try:
                self._process = process = LayoutProcess()
            except OSError:  # no more processes can be started
                return arrange_in_rows(graph, sizes)
        try:
            layout = process.arrange(graph, previous, sizes)
        finally:
            with self._changed:
                self._process = None
        return layout if layout is not None else arrange_in_rows(graph, sizes)
