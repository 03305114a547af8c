"""Fixtures and helpers of the ROS 2 tests in a separate network namespace: domains, nodes and programs."""

from __future__ import annotations

import struct
import textwrap
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

import pytest

import nep
from nep.backends.ros2.environment import cyclonedds_config
from tests.nep.programs import GREETINGS_S, Program, eventually, running

Make = Callable[[str], nep.Node]
_domains = count(1)


@pytest.fixture(autouse=True)
def a_domain_for_each_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """New domain for each test, because others see a killed program for ten more seconds."""
    monkeypatch.setenv("ROS_DOMAIN_ID", str(next(_domains)))


@pytest.fixture(autouse=True)
def all_are_patient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Longer handshake timeouts, so that programs find each other on a busy computer."""
    for module in ("participant", "publisher"):
        monkeypatch.setattr(f"nep.backends.ros2.{module}.HANDSHAKE_TIMEOUT_S", GREETINGS_S)


def knows(node: nep.Node, topic: str) -> nep.Node:
    """Wait until the node has discovered the topic. Return the node."""
    eventually(lambda: topic in {each.strip("/") for each in node.graph().topics})
    return node


@pytest.fixture(name="make")
def making() -> Iterator[Make]:
    made: list[nep.Node] = []

    def new(name: str) -> nep.Node:
        made.append(nep.node(name, "ROS2"))
        return made[-1]

    yield new
    for node in made:
        node.close()


BEGIN = f"""
import nep, os, sys, threading
from nep.backends.ros2 import participant, publisher
participant.HANDSHAKE_TIMEOUT_S = publisher.HANDSHAKE_TIMEOUT_S = {GREETINGS_S}
node = nep.node('other', 'ros2')
say = lambda it: print(it, flush=True)
def knows(topic):
    while topic not in {{each.strip('/') for each in node.graph().topics}}:
        threading.Event().wait(0.01)
"""


@contextmanager
def nep_program(code: str, **environment: str) -> Iterator[Program]:
    """Run a program with a node; at the end of the block, it stops because its standard input is closed."""
    with running(BEGIN + textwrap.dedent(code), **environment) as other:
        yield other
        other.end()


def killed_soon() -> dict[str, str]:
    """Return an environment in which others notice after 1 s instead of 10 s that a program was killed."""
    settings = cyclonedds_config({})
    assert settings is not None
    return {"CYCLONEDDS_URI": settings.replace("<Discovery>", "<Discovery><LeaseDuration>1s</LeaseDuration>")}


class Bytes:
    """Minimal CDR decoder."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    def take(self, form: str) -> object:
        if form == "I":
            self.at += -self.at % 4
        (value,) = struct.unpack_from(f"<{form}", self.data, self.at)
        self.at += struct.calcsize(form)
        return value

    def text(self) -> str:
        text = self.take(f"{self.take('I')}s")
        assert isinstance(text, bytes)
        return text.removesuffix(b"\0").decode()

    def gids(self) -> list[object]:
        return [self.take("16s") for _ in range(int(str(self.take("I"))))]
