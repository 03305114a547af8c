"""Isolated groups of nodes over each back end, for the contract tests of back ends."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

import nep

BACKENDS = ("memory", "zeromq", "nanomsg", "zenoh")
"""Back ends that are available on every computer that runs the tests."""
Make = Callable[[str], nep.Node]
_numbers = count()


def place_for(backend: str, master: str) -> str:
    """Return the address at which a group of nodes of this back end meets: the master's or a unique one."""
    own = f"meeting-{os.getpid()}-{next(_numbers)}"
    return {"memory": own, "zenoh": f"local/{own}"}.get(backend, master)


@contextmanager
def meeting(backend: str, where: str) -> Iterator[Make]:
    """Yield a function that creates nodes of one back end at an address; close the nodes afterwards."""
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
