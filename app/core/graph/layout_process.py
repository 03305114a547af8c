"""Layout of large graphs in a child process, because graphlay holds the GIL while it works.

`LayoutThread` starts this module. Standard input is the pickled arguments of `arrange`, standard output
the pickled result. Pickle is safe here, because parent and child are the same program.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

from app.core.graph.layout import GraphLayout, LayoutSizes, arrange
from app.core.graph.node_graph import NodeGraph
from app.core.reports.own_process import module_command
from nep.masters.process import NO_CONSOLE

TIMEOUT_S = 60.0
MAX_INLINE_NODES, MAX_INLINE_LINES = 40, 60
"""Maximum number of nodes and lines laid out in this process, which takes a few milliseconds."""


class LayoutProcess:
    """Child process that lays out one graph. `kill` may be called from another thread."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            module_command("app.core.graph.layout_process"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            creationflags=NO_CONSOLE,
        )

    def arrange(
        self, graph: NodeGraph, previous: GraphLayout | None, sizes: LayoutSizes
    ) -> GraphLayout | None:
        """Call `arrange` in the child process and return the layout.

        Returns None if the call failed, was killed, or took longer than `TIMEOUT_S` seconds.
        """
        graph_without_entries = replace(graph, nodes=tuple(replace(node, entry=None) for node in graph.nodes))
        try:
            output, _error_output = self._process.communicate(
                pickle.dumps((graph_without_entries, previous, sizes)), TIMEOUT_S
            )
        except (subprocess.TimeoutExpired, OSError, ValueError):
            self.kill()
            return None
        finally:
            self._clean_up()
        if self._process.returncode or not output:
            return None
        layout = pickle.loads(output)  # noqa: S301 - written by our own child
        return layout if isinstance(layout, GraphLayout) else None

    def _clean_up(self) -> None:
        # Closes the pipes and reaps the process.
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # unread input
                    pipe.close()
        self._process.wait()

    def kill(self) -> None:
        """Kill the process."""
        self._process.kill()


def is_large(graph: NodeGraph) -> bool:
    """Return True if a graph should be laid out in a child process."""
    lines = sum(len(line.sources) * len(line.targets) for line in graph.lines)
    return len(graph.nodes) > MAX_INLINE_NODES or lines > MAX_INLINE_LINES


def main() -> None:
    """Lay out the graph on standard input and write the result to standard output."""
    graph, previous, sizes = pickle.load(sys.stdin.buffer)  # noqa: S301 - written by our own parent
    sys.stdout.buffer.write(pickle.dumps(arrange(graph, previous, sizes)))
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
