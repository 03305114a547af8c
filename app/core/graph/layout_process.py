"""Large graphs get their places in a process of their own: the library holds Python's lock while it works.

Started by `LayoutThread` as a module. Standard input has what `arrange` is given, standard output what it
gives, both pickled: parent and child are the same program.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace

from app.core.graph.layout import GraphLayout, LayoutSizes, arrange
from app.core.graph.node_graph import NodeGraph
from app.core.own_process import module_command
from nep.masters.process import NO_CONSOLE

TIMEOUT_S = 60.0
MOST_HERE, MOST_LINES_HERE = 40, 60
"""Graphs up to this size take some milliseconds, far less than a process takes to start."""


class LayoutProcess:
    """Arranges one graph; another thread may end it by `kill`."""

    def __init__(self) -> None:
        """Start it."""
        self._process = subprocess.Popen(
            module_command("app.core.graph.layout_process"),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            creationflags=NO_CONSOLE,
        )

    def arrange(self, graph: NodeGraph, before: GraphLayout | None, sizes: LayoutSizes) -> GraphLayout | None:
        """As `arrange`; None when the process failed, was ended, or took longer than `TIMEOUT_S`."""
        bare = replace(graph, nodes=tuple(replace(node, entry=None) for node in graph.nodes))
        try:
            told, _nothing = self._process.communicate(pickle.dumps((bare, before, sizes)), TIMEOUT_S)
        except (subprocess.TimeoutExpired, OSError, ValueError):
            self.kill()
            return None
        finally:
            self._leave()
        if self._process.returncode or not told:
            return None
        made = pickle.loads(told)  # noqa: S301 - what our own child wrote
        return made if isinstance(made, GraphLayout) else None

    def _leave(self) -> None:
        """It has ended, or was: nothing of it stays open."""
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):  # what it did not read any more
                    pipe.close()
        self._process.wait()

    def kill(self) -> None:
        """End it at once, whatever it does."""
        self._process.kill()


def is_large(graph: NodeGraph) -> bool:
    """Whether a graph is better arranged by another process."""
    lines = sum(len(line.sources) * len(line.targets) for line in graph.lines)
    return len(graph.nodes) > MOST_HERE or lines > MOST_LINES_HERE


def main() -> None:
    """See the module."""
    graph, before, sizes = pickle.load(sys.stdin.buffer)  # noqa: S301 - what our own parent wrote
    sys.stdout.buffer.write(pickle.dumps(arrange(graph, before, sizes)))
    sys.stdout.buffer.flush()


if __name__ == "__main__":
    main()
