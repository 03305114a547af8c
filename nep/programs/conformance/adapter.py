"""Adapter under test: a program that executes requests with a client library.

Requests are written to its standard input; replies and events are read from its standard output, one JSON
object per line.
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
from nep.programs.conformance.verdict import printable

_MAX_LINE_BYTES = 64 * 2**20


class AdapterError(NepError):
    """Error for an adapter that can't be started or violates the adapter protocol."""


class AdapterStreams(Protocol):
    """Standard output (`output`) and standard input (`input`) of an adapter."""

    output: IO[bytes]
    input: IO[bytes]

    def wait(self, timeout_s: float) -> int | None:
        """Return the exit code, or None if the adapter is still running after `timeout_s` seconds."""

    def stop(self) -> None:
        """Stop the adapter, and kill it if it does not exit."""


class AdapterProcess:
    """Adapter process. The address of the master is passed in the environment variable NEP_MASTER.

    The constructor raises `AdapterError` if the process can't be started.

    Args:
        command: Command line of the adapter.
        master: Address of the master.
    """

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
                _("can't start '{command}': {error}").format(command=" ".join(command), error=error)
            ) from error
        stdout, stdin = self._process.stdout, self._process.stdin
        if stdout is None or stdin is None:
            raise AdapterError(
                _("'{command}' has no standard input or output").format(command=" ".join(command))
            )
        self.output: IO[bytes] = stdout
        self.input: IO[bytes] = stdin

    def wait(self, timeout_s: float) -> int | None:
        """Return the exit code, or None if the adapter is still running after `timeout_s` seconds."""
        try:
            return self._process.wait(timeout_s)
        except subprocess.TimeoutExpired:
            return None

    def stop(self) -> None:
        """Close the adapter's standard input, and kill the process if it does not exit within 3 s."""
        with suppress(OSError):
            self.input.close()
        if self.wait(3.0) is None:
            self._process.kill()
            self._process.wait()
        self.output.close()


class Adapter:
    """Client that sends requests to an adapter and collects the replies and events.

    A thread reads the adapter's output.

    Args:
        streams: Streams of the adapter.
    """

    def __init__(self, streams: AdapterStreams) -> None:
        self.streams = streams
        self.events: list[Mapping[str, Any]] = []
        """Messages received by the adapter's subscribers, in the order of the events."""
        self._replies: dict[int, Mapping[str, Any]] = {}
        self._incoming_lines: deque[bytes | None] = deque()
        self._request_count = 0
        self.has_ended = False
        self._reader = threading.Thread(target=self._read, daemon=True, name="nep wire check")
        self._reader.start()

    def _read(self) -> None:
        with suppress(OSError, ValueError):  # closed by `stop`
            while line := self.streams.output.readline(_MAX_LINE_BYTES):
                self._incoming_lines.append(line)
        self._incoming_lines.append(None)

    def send_request(self, do: str, **members: object) -> int:
        """Send a request without waiting for the reply.

        Args:
            do: Name of the request.
            members: Further fields of the request.

        Returns:
            Id of the request, to be passed to `reply`.

        Raises:
            AdapterError: The adapter's standard input is closed.
        """
        self._request_count += 1
        line = json.dumps({"id": self._request_count, "do": do, **members}).encode() + b"\n"
        try:
            self.streams.input.write(line)
            self.streams.input.flush()
        except (OSError, ValueError) as error:
            raise AdapterError(_("can't write to the adapter: {error}").format(error=error)) from error
        return self._request_count

    def reply(self, request_id: int) -> Mapping[str, Any] | None:
        """Return the reply to a request, or None if it has not arrived yet.

        Raises `AdapterError` if the reply is an error.
        """
        self.pump()
        reply = self._replies.get(request_id)
        if reply is None:
            return None
        if "error" in reply:
            raise AdapterError(
                _("the adapter reported an error: {error}").format(error=printable(reply["error"]))
            )
        return reply

    def pump(self) -> None:
        """Process the lines received so far. Raises `AdapterError` for a line that is not a JSON object."""
        while self._incoming_lines:
            line = self._incoming_lines.popleft()
            if line is None:
                self.has_ended = True
                continue
            try:
                message = json.loads(line)
            except ValueError:
                message = None
            if not isinstance(message, dict):
                raise AdapterError(
                    _("the adapter wrote {line}, which isn't a JSON object").format(line=printable(line))
                )
            if isinstance(message.get("re"), int):
                self._replies[message["re"]] = message
            elif message.get("event") == "message":
                self.events.append(message)

    def stop(self) -> None:
        """Stop the adapter and the reading thread."""
        self.streams.stop()
        self._reader.join(5.0)
