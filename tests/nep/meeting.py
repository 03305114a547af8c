"""Isolated groups of nodes over each back end, for the contract tests of back ends."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

import pytest

import nep
from tests.nep.programs import GREETINGS_S

BACKENDS = ("memory", "zeromq", "nanomsg", "zenoh")
"""Back ends that are available on every computer that runs the tests."""
Make = Callable[[str], nep.Node]
_numbers = count()


def place_for(backend: str, master: str) -> str:
    """Return the address at which a group of nodes of this back end meets: the master's or a unique one."""
    own = f"meeting-{os.getpid()}-{next(_numbers)}"
    return {"memory": own, "zenoh": f"local/{own}"}.get(backend, master)


def extend_handshakes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let nodes of this process wait so long for handshakes that a busy computer doesn't exceed it."""
    modules = ["zeromq.transport"]
    if importlib.util.find_spec("zenoh") is not None:
        modules += ["zenoh.transport", "zenoh.node_services"]
    for module in modules:
        monkeypatch.setattr(f"nep.backends.{module}.HANDSHAKE_TIMEOUT_S", GREETINGS_S)


@contextmanager
def meeting(backend: str, where: str) -> Iterator[Make]:
    """Yield a function that creates nodes of one back end at an address; close the nodes afterwards.

    The nodes wait long for handshakes: a test that lets one time out sets another limit itself.
    """
    made: list[nep.Node] = []

    def new(name: str) -> nep.Node:
        node = nep.node(name, backend, master=where)
        made.append(node)
        return node

    with pytest.MonkeyPatch.context() as monkeypatch:
        extend_handshakes(monkeypatch)
        try:
            yield new
        finally:
            for node in made:
                node.close()
