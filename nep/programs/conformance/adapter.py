"""The adapter under test: a program that does with a library what it is told.

Requests go to its standard input, replies and events come from its standard output: one JSON object a line.
"""

from __future__ import annotations

import json
import os
import subprocess
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO, Any, Protocol

from nep.errors import NepError
from nep.i18n import _
from nep.masters.process import NO_CONSOLE
from nep.programs.conformance.verdict import shown

__all__ = ["Adapter", "AdapterError", "AdapterProcess", "AdapterStreams"]

_MAX_LINE_BYTES = 64 * 2**20


class AdapterError(NepError):
    """The adapter does not do what the protocol of adapters asks for."""


class AdapterStreams(Protocol):
    """Two streams, and what is behind them."""

    reads: IO[bytes]
    writes: IO[bytes]

    def wait(self, timeout_s: float) -> int | None:
        """Return the exit code when it has ended within this time, else None."""

    def end(self) -> None:
        """End it, whatever it does."""


class AdapterProcess:
    """An adapter that is started as a command, with the master's address in NEP_MASTER."""

    def __init__(self, command: Sequence[str], master: str) -> None:
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, "NEP_MASTER": master},
                creationflags=NO_CONSOLE,
            )
        except OSError as error:
            raise AdapterError(
                _("'{command}' cannot be started: {error}").format(command=" ".join(command), error=error)
            ) from error
        reads, writes = self._process.stdout, self._process.stdin
        if reads is None or writes is None:
            raise AdapterError(_("'{command}' has no streams").format(command=" ".join(command)))
        self.reads: IO[bytes] = reads
        self.writes: IO[bytes] = writes

    def wait(self, timeout_s: float) -> int | None:
        """Return the exit code when it has ended within this time, else None."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def end(self) -> None:
        """Close its stdin, and kill it when it does not end by itself."""
        with suppress(OSError):
            self.writes.close()
        if self.wait(3.0) is None:
            self._process.kill()
            self._process.wait()
        self.reads.close()


class Adapter:
    """Requests to the adapter, and what it says. Only the thread that reads its lines is another one."""

    def __init__(self, lines: AdapterStreams) -> None:
        self.lines = lines
        self.events: list[Mapping[str, Any]] = []
        """Messages that its subscribers have received, in the order in which it told of them."""
        self._replies: dict[int, Mapping[str, Any]] = {}
        self._incoming: deque[bytes | None] = deque()
        self._count = 0
        self.has_ended = False
        self._reader = threading.Thread(target=self._read, daemon=True, name="nep wire check")
        self._reader.start()

    def _read(self) -> None:
        with suppress(OSError, ValueError):  # it was closed
            while line := self.lines.reads.readline(_MAX_LINE_BYTES):
                self._incoming.append(line)
        self._incoming.append(None)

    def begin(self, do: str, **members: object) -> int:
        """Tell the adapter to do something; its number, for `reply`."""
        self._count += 1
        line = json.dumps({"id": self._count, "do": do, **members}).encode() + b"\n"
        try:
            self.lines.writes.write(line)
            self.lines.writes.flush()
        except (OSError, ValueError) as error:
            raise AdapterError(_("the adapter takes no requests: {error}").format(error=error)) from error
        return self._count

    def reply(self, number: int) -> Mapping[str, Any] | None:
        """Return the reply to a request when it has come. Raises `AdapterError` when it says an error."""
        self.pump()
        reply = self._replies.get(number)
        if reply is None:
            return None
        if "error" in reply:
            raise AdapterError(_("the adapter says: {error}").format(error=shown(reply["error"])))
        return reply

    def pump(self) -> None:
        """Take what has come."""
        while self._incoming:
            line = self._incoming.popleft()
            if line is None:
                self.has_ended = True
                continue
            try:
                said = json.loads(line)
            except ValueError:
                said = None
            if not isinstance(said, dict):
                raise AdapterError(_("the adapter says {line}, which is no JSON").format(line=shown(line)))
            if isinstance(said.get("re"), int):
                self._replies[said["re"]] = said
            elif said.get("event") == "message":
                self.events.append(said)

    def end(self) -> None:
        """End the adapter, and its thread."""
        self.lines.end()
        self._reader.join(5.0)
