"""Nodes of one back end that can meet, and nobody else: what the contracts of back ends are tried with."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

import nep

BACKENDS = ("memory", "zeromq", "nanomsg", "zenoh")
"""Those that every computer has on which the tests run."""
Make = Callable[[str], nep.Node]
_numbers = count()


def place_for(backend: str, master: str) -> str:
    """Where nodes of this back end meet that belong together: the master, or a place of their own."""
    own = f"meeting-{os.getpid()}-{next(_numbers)}"
    return {"memory": own, "zenoh": f"local/{own}"}.get(backend, master)


@contextmanager
def meeting(backend: str, where: str) -> Iterator[Make]:
    """Makes nodes that meet there; closes them."""
    made: list[nep.Node] = []

    def new(name: str) -> nep.Node:
        node = nep.node(name, backend, master=where)
        made.append(node)
        return node

    try:
        yield new
    finally:
        for node in made:
            node.close()
