"""Test of two computers, which are network namespaces joined by a virtual cable."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.nep.programs import Program, eventually, running

MASTER = """
import nep, sys
from nep.masters.master import Master
with Master("127.0.0.1:7780", learn_s=0.0) as master:
    master.listen(["10.77.0.1"])
    print("ready")
    sys.stdin.readline()
"""
SUBSCRIBER = """
import json, nep, sys
node = nep.node("subscriber", sys.argv[1])
sub = node.new_sub("t")
print("ready")
while True:
    message = sub.receive(0.2)
    if message is not None:
        print(json.dumps(message.payload))
"""
PUBLISHER = """
import nep, sys
node = nep.node("publisher", sys.argv[1])
pub = node.new_pub("t", latched=True)
print(pub.subscribers)
for line in sys.stdin:
    pub.publish(line.strip())
"""
GRAPH = """
import json, nep
node = nep.node("graph")
print(json.dumps([each.endpoints for each in node.graph().topics["t"].publishers]))
"""
WAIT_S = 60.0


def ip(*words: str) -> None:
    subprocess.run(["ip", *words], check=True, capture_output=True, timeout=10)


class Computers:
    """Two network namespaces, "a" and "b", with the addresses 10.77.0.1 and 10.77.0.2."""

    def __init__(self) -> None:
        self.names = {side: f"nep{side}{os.getpid()}" for side in "ab"}
        for name in self.names.values():
            ip("netns", "add", name)
            ip("-n", name, "link", "set", "lo", "up")
        a, b = self.names.values()
        ip("-n", a, "link", "add", "cable", "type", "veth", "peer", "name", "cable", "netns", b)
        for number, name in enumerate(self.names.values(), 1):
            ip("-n", name, "addr", "add", f"10.77.0.{number}/24", "dev", "cable")
            ip("-n", name, "link", "set", "cable", "up")

    def inside(self, side: str) -> list[str]:
        """Return the command prefix that runs a program in that namespace."""
        return ["ip", "netns", "exec", self.names[side]]

    def change_address(self, side: str, old: str, new: str) -> None:
        """Change the address, as a switch to another Wi-Fi network does."""
        ip("-n", self.names[side], "addr", "del", f"{old}/24", "dev", "cable")
        ip("-n", self.names[side], "addr", "add", f"{new}/24", "dev", "cable")

    def cable(self, state: str) -> None:
        """Unplug the cable ("down") or plug it in ("up")."""
        ip("-n", self.names["b"], "link", "set", "cable", state)

    def remove(self) -> None:
        for name in self.names.values():
            subprocess.run(["ip", "netns", "del", name], check=False, capture_output=True, timeout=10)


@pytest.fixture
def computers(tmp_path: Path) -> Iterator[Computers]:
    if not sys.platform.startswith("linux") or shutil.which("ip") is None:
        pytest.skip("two computers are made with Linux's network namespaces and the command ip")
    try:
        made = Computers()
    except (subprocess.CalledProcessError, OSError) as error:
        pytest.skip(f"network namespaces may not be made here: {error}")
    yield made
    made.remove()


def hears(subscriber: Program, text: str) -> None:
    """Read the subscriber's output up to this message; raise AssertionError if the program exits."""
    for line in iter(subscriber.line, None):
        if json.loads(line) == text:
            return


def advertised(computers: Computers) -> str:
    with running(GRAPH, before=computers.inside("a"), NEP_MASTER="127.0.0.1:7780") as asking:
        return asking.line()


@pytest.mark.timeout(240)
@pytest.mark.parametrize("backend", ["zeromq", pytest.param("nanomsg", marks=pytest.mark.long)])
def test_two_computers_communicate_after_an_address_change_and_a_cable_reconnection(
    computers: Computers, backend: str
) -> None:
    near = {"before": computers.inside("a"), "NEP_MASTER": "127.0.0.1:7780"}
    far = {"before": computers.inside("b"), "NEP_MASTER": "10.77.0.1:7780"}
    with ExitStack() as stack:
        assert stack.enter_context(running(MASTER, **near)).line() == "ready"
        subscriber = stack.enter_context(running(SUBSCRIBER, backend, **near))
        assert subscriber.line() == "ready"
        publisher = stack.enter_context(running(PUBLISHER, backend, **far))
        assert publisher.line() == "1", "the subscriber answered before new_pub returned"
        publisher.say("first")
        assert json.loads(subscriber.line()) == "first"
        with running(SUBSCRIBER, backend, **far) as other:
            assert other.line() == "ready"
            with running(PUBLISHER, backend, **near) as here:
                assert here.line() == "2"
                here.say("to both")
                hears(other, "to both")
                hears(subscriber, "to both")

        computers.change_address("b", "10.77.0.2", "10.77.0.3")
        eventually(lambda: "10.77.0.3" in advertised(computers), WAIT_S)
        publisher.say("from the new address")
        hears(subscriber, "from the new address")

        computers.cable("down")
        publisher.say("nobody can hear this now")
        eventually(lambda: "10.77.0.3" not in advertised(computers), WAIT_S)
        computers.cable("up")
        eventually(lambda: "10.77.0.3" in advertised(computers), WAIT_S)
        publisher.say("back again")
        hears(subscriber, "back again")
