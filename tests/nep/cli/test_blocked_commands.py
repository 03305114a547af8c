"""Tests of commands whose terminal accepts no output, because of Ctrl+S or because no process reads it.

Neither the command nor other nodes may block.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import pytest

import nep
from nep.masters.master import is_running
from tests.nep.programs import ROOT, eventually

if sys.platform == "win32":
    pytest.skip("pseudo terminals are Unix's", allow_module_level=True)

LONG_S = 50.0
STOP, GO_ON, INTERRUPT = b"\x13", b"\x11", b"\x03"  # Ctrl+S, Ctrl+Q, Ctrl+C
QUIET = 20
"""Number of consecutive reads without new output after which the output counts as paused."""
IN_ITS_TERMINAL = """
import fcntl, os, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
os.execv(sys.argv[1], sys.argv[1:])
"""


class Shown:
    """Command in its own pseudo-terminal, with the text that it has printed."""

    def __init__(self, *words: str, master: str) -> None:
        self.keys, terminal = os.openpty()
        self.process = subprocess.Popen(
            [sys.executable, "-c", IN_ITS_TERMINAL, sys.executable, "-m", "nep", *words],
            stdin=terminal,
            stdout=terminal,
            stderr=terminal,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), "NEP_MASTER": master},
        )
        os.close(terminal)
        os.set_blocking(self.keys, False)
        self.text = ""

    def look(self) -> str:
        """Read the available output and return all text since the start."""
        with suppress(BlockingIOError, OSError):  # no output yet, or the process has ended
            while data := os.read(self.keys, 65536):
                self.text += data.decode("utf-8", "replace")
        return self.text

    def press(self, keys: bytes) -> None:
        os.write(self.keys, keys)

    def stop_it(self) -> None:
        """Press Ctrl+S and wait until no more output arrives."""
        self.press(STOP)
        lengths: list[int] = []

        def pause_reading() -> bool:
            lengths.append(len(self.look()))
            return len(set(lengths[-QUIET:])) == 1 and len(lengths) > QUIET

        eventually(pause_reading, LONG_S)


@contextmanager
def shown(*words: str, master: str) -> Iterator[Shown]:
    made = Shown(*words, master=master)
    try:
        yield made
    finally:
        made.process.kill()
        made.process.wait(LONG_S)
        os.close(made.keys)


@contextmanager
def talking(node: nep.Node) -> Iterator[None]:
    """Publish and log about 300 times a second; check that a subscriber received the first message."""
    pub, ended = node.new_pub("flood"), threading.Event()
    heard = node.new_sub("flood", max_messages=10**6)
    node.log.propagate = False  # keeps the log out of the test's output

    def talk() -> None:
        number = 0
        while not ended.wait(0.003):
            pub.publish({"number": number, "more": "x" * 300})
            node.log.error("number %d is wrong %s", number, "x" * 100)
            number += 1

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield
        first = heard.receive(LONG_S)
        assert first is not None
        assert first.seq == 1
    finally:
        ended.set()
        thread.join()


@pytest.mark.parametrize(
    "words", [("topic", "echo", "flood"), ("topic", "echo", "flood", "--json"), ("log",)], ids="-".join
)
def test_command_with_paused_output_does_not_affect_unrelated_topics(
    master: nep.Master, words: tuple[str, ...]
) -> None:
    with nep.node("talker") as node, shown(*words, master=master.address) as command, talking(node):
        eventually(lambda: "number" in command.look(), LONG_S)
        command.stop_it()
        before = len(command.text)
        with node.new_sub("/other") as heard, node.new_pub("/other") as pub:
            pub.publish("still")
            assert heard.listen(timeout_s=LONG_S) == (True, "still")
        # The master still knows it.
        eventually(
            lambda: any(str(command.process.pid) in each.name for each in node.graph().nodes.values()), LONG_S
        )
        command.press(GO_ON)
        eventually(lambda: len(command.look()) > before + 1000, LONG_S)
        command.press(INTERRUPT)
        eventually(lambda: command.look() is not None and command.process.poll() is not None, LONG_S)
        assert command.process.returncode == 130
        assert "Traceback" not in command.text


@pytest.mark.parametrize(
    "words", [("topic", "echo", "flood", "no.such.field"), ("topic", "echo", "flood", "number")]
)
def test_interrupt_ends_a_command_with_blocked_output(master: nep.Master, words: tuple[str, ...]) -> None:
    with nep.node("talker") as node, shown(*words, master=master.address) as command, talking(node):
        eventually(lambda: "#" in command.look() or "number" in command.text, LONG_S)
        command.stop_it()
        command.process.send_signal(signal.SIGINT)
        assert command.process.wait(LONG_S) == 130


def test_master_with_blocked_output_keeps_serving() -> None:
    with nep.master("127.0.0.1:0", learn_s=0.0) as free:
        address = free.address
    with shown("master", "--no-gateway", master=address) as command:
        eventually(lambda: is_running(address, 0.5), LONG_S)
        eventually(lambda: "press Ctrl+C to stop" in command.look(), LONG_S)
        command.press(STOP)
        with nep.node("loud", master=address) as node:
            pairs = [(node.new_pub(f"/{n}", "json"), node.new_pub(f"/{n}", "string")) for n in range(20)]
            eventually(lambda: len(node.graph().alerts) == len(pairs), LONG_S)
            with node.new_sub("/still") as heard, node.new_pub("/still") as pub:
                pub.publish("here")
                assert heard.listen(timeout_s=LONG_S) == (True, "here")
            command.press(GO_ON)
            eventually(lambda: "“/19”" in command.look(), LONG_S)
        command.press(INTERRUPT)
        eventually(lambda: command.look() is not None and command.process.poll() is not None, LONG_S)
        assert command.process.returncode == 130
        assert "Traceback" not in command.text
