"""Tests of output to a terminal that blocks: neither the writer nor the node's other work waits for it."""

from __future__ import annotations

import io
import logging
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

import nep
from nep.masters.master import is_running
from nep.system.terminal import LineFormatter, Terminal
from tests.nep.programs import eventually, running

if sys.platform == "linux":
    import fcntl

ON_LINUX = pytest.mark.skipif(sys.platform != "linux", reason="pipes of a chosen size are Linux's")


class Stuck(io.StringIO):
    """Stream whose `write` blocks until `may_go_on` is set."""

    def __init__(self) -> None:
        super().__init__()
        self.begins, self.may_go_on = threading.Event(), threading.Event()

    def write(self, text: str) -> int:
        self.begins.set()
        assert self.may_go_on.wait(60.0)
        return super().write(text)


@pytest.fixture(autouse=True)
def _long_close_timeout(monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait long for pending output, so that a busy computer doesn't exceed the limit."""
    monkeypatch.setattr(Terminal.close, "__defaults__", (60.0,))


@pytest.fixture
def stuck() -> Iterator[Stuck]:
    made = Stuck()
    yield made
    made.may_go_on.set()


def test_write_never_blocks_and_dropped_output_is_reported(stuck: Stuck) -> None:
    terminal = Terminal(stuck, max_characters=100)
    terminal.write("first\n")
    assert stuck.begins.wait(30.0)
    for n in range(1000):
        assert terminal.write(f"line {n}\n") > 0
        terminal.flush()
    terminal.close(0.0)  # close doesn't block either
    stuck.may_go_on.set()
    eventually(lambda: "dropped" in stuck.getvalue())
    lines = stuck.getvalue().splitlines()
    assert lines[:3] == ["first", "line 0", "line 1"]
    kept = len(lines) - 2
    assert lines[-1] == f"… {1000 - kept} lines dropped because the output wasn't read"
    assert terminal.write("too late") == 8
    terminal.close()


def test_text_larger_than_the_buffer_is_written_when_nothing_is_pending() -> None:
    stream = io.StringIO()
    with Terminal(stream, max_characters=10) as terminal:
        terminal.write("x" * 50)
    assert stream.getvalue() == "x" * 50


def test_all_output_is_written_before_close() -> None:
    stream = io.StringIO()
    with Terminal(stream) as terminal:
        for n in range(500):
            terminal.write(f"{n}\n")
    assert stream.getvalue().splitlines() == [str(n) for n in range(500)]
    terminal.close()


def test_drain_waits_for_pending_output_up_to_the_timeout(stuck: Stuck) -> None:
    terminal = Terminal(stuck)
    assert terminal.drain(0.0)
    terminal.write("last words\n")
    assert stuck.begins.wait(30.0)
    assert not terminal.drain(0.0)
    stuck.may_go_on.set()
    assert terminal.drain(30.0)
    assert stuck.getvalue() == "last words\n"
    terminal.close()


def test_missing_or_broken_stream_is_tolerated() -> None:
    with Terminal(None) as nowhere:
        assert nowhere.write("x") == 1
        assert not nowhere.isatty()
    reading, writing = os.pipe()
    os.close(reading)
    with io.TextIOWrapper(io.FileIO(writing, "w")) as broken, Terminal(broken) as terminal:
        terminal.write("x\n")
        eventually(lambda: terminal._has_failed)
        assert terminal.write("y\n") == 2


def test_unencodable_characters_are_escaped(tmp_path: Path) -> None:
    path = tmp_path / "out"
    with path.open("w", encoding="ascii") as stream, Terminal(stream) as terminal:
        terminal.write("● “é”\n")
    assert path.read_bytes() == b"\\u25cf \\u201c\\xe9\\u201d" + os.linesep.encode()


@pytest.mark.skipif(not hasattr(os, "set_blocking"), reason="Windows has it from Python 3.12 on")
def test_non_blocking_pipe_receives_all_output() -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    text = "x" * 300_000 + "\n"
    with io.TextIOWrapper(io.FileIO(writing, "w")) as stream, Terminal(stream) as terminal:
        terminal.write(text)
        got = b""
        while len(got) < len(text):
            got += os.read(reading, 65536)
    os.close(reading)
    assert got.decode() == text


def test_control_characters_in_log_records_are_escaped() -> None:
    record = logging.LogRecord("n\x1b[2J", logging.INFO, "f", 1, "two\nlines \x9b31m %s", ("\u202ex",), None)
    assert LineFormatter("%(name)s: %(message)s").format(record) == "n\\x1b[2J: two\nlines \\x9b31m \\u202ex"


def master_writing_to(writing: int, state: Path, reading: int) -> tuple[subprocess.Popen[bytes], str]:
    """Start `nep master` as a process that writes to `writing`; return it and its address when it replies.

    The start is repeated at another port if the free one is taken in the meantime. `reading` is the
    other end of `writing`; the output of failed attempts is read from it for the error message.
    """
    ended: list[str] = []
    while len(ended) < 5:
        with nep.master("127.0.0.1:0", learn_s=0.0) as free:
            address = free.address
        command = [sys.executable, "-m", "nep", "master", "--no-gateway", "--port"]
        process = subprocess.Popen(
            [*command, address.rpartition(":")[2]],
            stdout=writing,
            stderr=writing,
            env={**os.environ, "NEP_STATE_DIR": str(state)},
        )
        try:
            eventually(lambda: process.poll() is not None or is_running(address, 0.5))  # noqa: B023
        except AssertionError:
            process.kill()
            process.wait(60.0)
            raise
        if process.poll() is None:
            return process, address
        ended.append(f"{process.returncode}: {os.read(reading, 4096).decode()}")
    raise AssertionError(f"the master ended each time: {ended}")


@ON_LINUX
@pytest.mark.usefixtures("patient")
def test_master_with_a_blocked_terminal_keeps_serving_and_exits(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, 4096)
    process, address = master_writing_to(writing, tmp_path, reading)
    os.close(writing)
    try:
        with nep.node("loud", master=address) as node:
            for n in range(20):  # each raises an alert of some hundred characters
                topic = f"/{n}/" + "x" * 180
                pair = node.new_pub(topic, "json"), node.new_pub(topic, "string")
                assert pair[0].id != pair[1].id
            eventually(lambda: len(node.graph().alerts) == 20)
            heard, said = node.new_sub("/still"), node.new_pub("/still")
            said.publish("here")
            assert heard.listen(timeout_s=30.0) == (True, "here")
        assert is_running(address, 30.0)
        process.send_signal(signal.SIGTERM)
        assert process.wait(60.0) == 0
    finally:
        process.kill()
        process.wait(60.0)
        os.close(reading)


@pytest.mark.parametrize("ends", [False, True])
def test_output_waits_until_a_writer_thread_can_be_started_unless_closed(
    monkeypatch: pytest.MonkeyPatch, ends: bool
) -> None:
    """From Python 3.12 on, no thread can be started while the interpreter shuts down."""
    given = io.StringIO()
    terminal = Terminal(given)

    def no_thread(_thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", no_thread)
        assert terminal.write("first\n") == 6
        terminal.close(30.0) if ends else terminal.write("second\n")
    terminal.write("there\n")
    terminal.close(30.0)
    assert given.getvalue().splitlines() == ([] if ends else ["first", "second", "there"])


@pytest.mark.skipif(not hasattr(os, "fork"), reason="Windows has no fork")
def test_forked_child_can_write_to_the_terminal() -> None:
    """The writer thread of the parent does not exist in the child, so its output would wait forever."""
    code = """
    import os, sys
    from nep.system.terminal import Terminal
    terminal = Terminal(sys.stdout)
    terminal.write("parent\\n")
    assert terminal.drain(30.0)
    terminal._condition.acquire()  # another thread writes just now
    child = os.fork()
    if child == 0:
        terminal.write("child\\n")
        terminal.close(30.0)
        os._exit(0)
    terminal._condition.release()
    print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
    """
    with running(code) as program:
        assert [program.line() for _ in range(3)] == ["parent", "child", "0"]
