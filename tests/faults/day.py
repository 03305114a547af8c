"""Master, publishers and subscribers on the hosts of a fault test, with their message counts."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from time import monotonic
from typing import Any

import psutil

from tests.faults import traffic
from tests.faults.hosts import Host, Network
from tests.nep.programs import Program, eventually, running

WAIT_S = 60.0
"""Timeout in seconds for conditions that must become true, even on a busy computer."""
_MASTER = "from nep.cli import main; main()"


class Part:
    """Program of `traffic` that runs on a host."""

    def __init__(self, program: Program, host: Host) -> None:
        self.host = host
        self._program = program
        assert program.line() == "ready"

    def ask(self, what: str) -> dict[str, Any]:
        """Send a request to the program and return its reply.

        Raises:
            AssertionError: If the program reports an error.
        """
        self._program.say(what)
        answer: dict[str, Any] = json.loads(self._program.line())
        assert not answer.get("error"), answer["error"]
        return answer

    def hold(self, *, is_held: bool) -> None:
        """Suspend or resume the program, as a debugger does."""
        process = psutil.Process(self._program.process.pid).children(recursive=True)[-1]
        if is_held:
            process.suspend()
        else:
            process.resume()


class Master:
    """Running master and its host."""

    def __init__(self, program: Program, host: Host) -> None:
        self.host = host
        self.kill = program.kill


class Day:
    """Programs on the hosts of one test; they are killed at its end.

    `backend` is that of their nodes, and `address` the one at which other hosts reach the master.
    """

    def __init__(self, hosts: Network, stack: ExitStack, backend: str) -> None:
        self.hosts = hosts
        self.backend = backend
        self.address = ""
        self.master: Master
        self._stack = stack

    def begin_master(self, host: Host) -> float:
        """Start a master from the command line, wait until it serves and return the time of its start."""
        began = now()
        self.address = f"{host.address}:7780"
        words = ("master", "--no-gateway", "--listen", host.address)
        # `nep` takes its program name from argv[0].
        code = f"import sys; sys.argv[0] = 'nep'; {_MASTER}"
        program = self._stack.enter_context(running(code, *words, before=host.inside(), NEP_MASTER=""))
        assert program.process.stderr is not None
        for line in program.process.stderr:
            if "NEP_MASTER=" in line:
                self.master = Master(program, host)
                return began
        raise AssertionError("the master ended")

    def start(
        self, part: Callable[[], None], host: Host, topic: str, *, master: str = "", **more: Any
    ) -> Part:
        """Start a program of `traffic` on a host and wait until it is ready."""
        options = json.dumps(
            {"node": f"{part.__name__}-{host.name}", "topic": topic, "backend": self.backend, **more}
        )
        program = running(
            traffic.code_of(part),
            options,
            before=host.inside(),
            is_patient=False,  # a peer may be unreachable
            NEP_MASTER=self.address,
            XDG_RUNTIME_DIR=f"/dev/shm/{host.name}",
        )
        return Part(self._stack.enter_context(program), host)


@contextmanager
def day(hosts: Network, backend: str) -> Iterator[Day]:
    """Yield a `Day` and kill its programs at the end."""
    with ExitStack() as stack:
        yield Day(hosts, stack, backend)


def balance(sent: int, subscriber: Part) -> dict[str, Any]:
    """Wait until every sent message is received or counted as lost; return the subscriber's counts.

    Every received message must have been delivered once and in order.
    """
    seen: dict[str, Any] = {}

    def is_met() -> bool:
        seen.update(subscriber.ask("look"))
        return bool(seen["received"] + seen["lost"] == sent == seen["read"] + seen["lost"])

    try:
        eventually(is_met, WAIT_S)
    except AssertionError:
        raise AssertionError(f"{sent} were sent, but the subscriber counted {seen}") from None
    assert seen["twice"] == seen["backwards"] == seen["refused"] == 0, seen
    return seen


def is_hearing(subscriber: Part) -> Callable[[], bool]:
    """Return a function that checks whether the subscriber has received messages since this call."""
    before = subscriber.ask("look")["read"]
    return lambda: bool(subscriber.ask("look")["read"] > before)


def now() -> float:
    """Return the monotonic time in seconds, which all hosts share."""
    return monotonic()
