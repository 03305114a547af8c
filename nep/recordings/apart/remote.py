"""Client of the process that reads recordings (`nep.recordings.apart.reader_process`).

If the process takes too long, needs too much memory or crashes, reads from its files raise `RecordingError`.
Opening the next file starts a new process.
"""

from __future__ import annotations

import queue
import subprocess
import threading
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from nep.errors import ClosedError, RecordingError, RecordingTooLargeError
from nep.i18n import _
from nep.masters.process import NO_CONSOLE
from nep.recordings.apart.frames import corruption_from_plain, file_info_from_plain, read_frame, write_frame
from nep.recordings.file_reader import CACHE_BYTES, FileInfo
from nep.recordings.formats.index import CorruptRange
from nep.recordings.formats.records import RawMessage, records_in
from nep.recordings.reader import Recording

if TYPE_CHECKING:
    from typing_extensions import Self


_REQUEST_TIMEOUT_S = 60.0
_CLOSE_TIMEOUT_S = 5.0
_FIRST_BATCH_MESSAGES, _BATCH_GROWTH_FACTOR, _MAX_BATCH_MESSAGES = 16, 4, 4_096


class ReaderProcess:
    """Process that reads recordings. Thread-safe; usable as a context manager.

    Requests are executed one at a time. Iterators request at most a megabyte at a time, so that other
    requests don't wait long.
    """

    def __init__(self, command: Sequence[str], *, timeout_s: float = _REQUEST_TIMEOUT_S) -> None:
        """Store the settings; the process is started by `open`.

        Args:
            command: Command line of `nep.recordings.apart.reader_process`.
            timeout_s: Time limit of a request in seconds, after which the process is killed. Opening a file
                may take longer as long as there is progress.
        """
        self._command, self._timeout_s = command, timeout_s
        self._lock = threading.Lock()
        self._is_closed = False
        self._pipe: _Pipe | None = None

    def open(
        self,
        path: Path,
        *,
        cache_bytes: int = CACHE_BYTES,
        progress: Callable[[int, int], object] | None = None,
        budget: tuple[int, float | None] | None = None,
    ) -> Recording:
        """Open a recording, starting the process if needed.

        Args:
            path: File to open.
            cache_bytes: Maximum size of the decompressed chunks that the process caches for this file.
            progress: Called with bytes done and in total while the file is scanned. An exception kills
                the process and propagates.
            budget: Maximum work for the file, including opening, as (bytes, seconds), where the seconds
                may be None for no limit; None limits only opening.

        Raises:
            RecordingError: The file can't be opened, or the process can't be started.
            RecordingTooLargeError: The file exceeds the budget.
            ClosedError: `close` was called.
        """
        with self._lock:
            if self._is_closed:
                raise ClosedError(f"recording '{path.name}'")
            if self._pipe is None or self._pipe.has_ended:
                self._pipe = _Pipe(self._command, path)
            pipe = self._pipe
        request = {"op": "open", "path": str(path), "cache_bytes": cache_bytes, "budget": budget}
        reply = pipe.request(path, request, self._timeout_s, progress)
        return Recording(path, file=_RemoteFile(pipe, path, reply, self._timeout_s))

    def close(self) -> None:
        """Kill the process; concurrent reads raise `ClosedError`. Idempotent."""
        with self._lock:
            self._is_closed = True
            pipe, self._pipe = self._pipe, None
        if pipe is not None:
            pipe.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()


class _Pipe:
    """Running process with its pipes.

    A thread reads the replies, so that waiting for a reply can time out.
    """

    def __init__(self, command: Sequence[str], path: Path) -> None:
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                creationflags=NO_CONSOLE,
                start_new_session=True,  # Ctrl+C in the terminal is for the parent
            )
        except OSError as error:
            reason = _("the process that reads the file can't start: {error}")
            raise RecordingError(str(path), reason.format(error=error)) from error
        self._lock = threading.Lock()
        self._is_closed = False
        self._replies: queue.Queue[dict[str, object] | None] = queue.Queue(2)
        self._thread = threading.Thread(target=self._read, name="recording-answers", daemon=True)
        self._thread.start()

    @property
    def has_ended(self) -> bool:
        return self._is_closed or self._process.poll() is not None

    def _read(self) -> None:
        out = self._process.stdout
        frame: dict[str, object] | None = {}
        while frame is not None:
            frame = None
            if out is not None:
                with suppress(OSError, ValueError):  # the process has ended
                    frame = read_frame(out)
            self._replies.put(frame)

    def request(
        self,
        path: Path,
        request: Mapping[str, object],
        timeout_s: float,
        progress: Callable[[int, int], object] | None = None,
    ) -> dict[str, Any]:
        # Raises `RecordingError`, `ClosedError`.
        with self._lock:
            self._check_open(path)
            stdin: IO[bytes] | None = self._process.stdin
            with suppress(OSError, ValueError):  # the reply is then missing, too
                if stdin is not None:
                    write_frame(stdin, request)
            while True:
                try:
                    reply = self._replies.get(timeout=timeout_s)
                except queue.Empty:
                    self._kill()
                    raise RecordingTooLargeError(str(path), _("reading the file takes too long")) from None
                if reply is None:
                    self._replies.put(None)
                    self._check_open(path)
                    self._kill()
                    reason = _("the process that reads the file stopped; the file may be damaged")
                    raise RecordingError(str(path), reason)
                if "progress" not in reply:
                    break
                reported = reply["progress"]
                try:
                    if progress is not None and isinstance(reported, list):
                        progress(*reported)
                except BaseException:
                    self._kill()
                    raise
        if "error" in reply:
            kind = RecordingTooLargeError if reply.get("is_too_large") else RecordingError
            raise kind(str(reply.get("path") or path), str(reply["error"]))
        return reply

    def _check_open(self, path: Path) -> None:
        if self._is_closed:
            raise ClosedError(f"recording '{path.name}'")

    def close(self) -> None:
        # Also interrupts a thread that waits for a reply.
        self._is_closed = True
        self._kill()

    def _kill(self) -> None:
        with suppress(OSError):
            self._process.kill()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(_CLOSE_TIMEOUT_S)
        while self._thread.is_alive():  # the reader thread may wait for room in the queue
            with suppress(queue.Empty):
                self._replies.get_nowait()
            self._thread.join(0.01)
        for stream in (self._process.stdin, self._process.stdout):
            with suppress(OSError, ValueError):
                if stream is not None:
                    stream.close()
        with suppress(queue.Full):
            self._replies.put_nowait(None)


class _RemoteFile:
    """File that is open in the reader process (a `RawFile`)."""

    def __init__(self, pipe: _Pipe, path: Path, open_reply: Mapping[str, Any], timeout_s: float) -> None:
        self._pipe, self._path, self._timeout_s = pipe, path, timeout_s
        self._number = open_reply["file"]
        self._is_closed = False
        self._damage = corruption_from_plain(open_reply.get("damage"))
        self.info: FileInfo = file_info_from_plain(open_reply["facts"])

    @property
    def corruption(self) -> Sequence[CorruptRange]:
        return self._damage

    def _request(self, op: str, **request: object) -> dict[str, Any]:
        if self._is_closed:
            raise ClosedError(f"recording '{self._path.name}'")
        content = {"op": op, "file": self._number, **request}
        reply = self._pipe.request(self._path, content, self._timeout_s)
        if "damage" in reply:
            self._damage = corruption_from_plain(reply["damage"])
        return reply

    def read_raw(
        self,
        start_ns: int | None,
        end_ns: int | None,
        channels: Collection[int],
        chunk_indexes: Collection[int] | None = None,
    ) -> Iterator[RawMessage]:
        if not channels:
            return
        max_count = _FIRST_BATCH_MESSAGES
        reply = self._request(
            "raw",
            start_ns=_clamp_time(start_ns),
            end_ns=_clamp_time(end_ns),
            channels=list(channels),
            pieces=None if chunk_indexes is None else list(chunk_indexes),
            most=max_count,
        )
        while reply["cursor"]:
            for record in records_in(reply["messages"]):
                if isinstance(record, RawMessage):
                    yield record
            max_count = min(_BATCH_GROWTH_FACTOR * max_count, _MAX_BATCH_MESSAGES)
            reply = self._request("next", cursor=reply["cursor"], most=max_count)

    def newest(self, at_ns: int, groups: Sequence[Collection[int]]) -> list[RawMessage | None]:
        if not groups:
            return []
        reply = self._request("newest", at_ns=_clamp_time(at_ns), groups=[list(each) for each in groups])
        messages = (each for each in records_in(reply["messages"]) if isinstance(each, RawMessage))
        return [next(messages, None) if has_message else None for has_message in reply["are_there"]]

    def newest_times(self, at_ns: int, channels: Collection[int]) -> dict[int, int]:
        times: dict[int, int] = self._request(
            "newest_times", at_ns=_clamp_time(at_ns), channels=list(channels)
        )["times"]
        return times

    def densities(
        self, start_ns: int, end_ns: int, buckets: int, channels: Collection[int]
    ) -> dict[int, Sequence[int]]:
        span = {"start_ns": _clamp_time(start_ns), "end_ns": _clamp_time(end_ns)}
        reply = self._request("densities", **span, buckets=buckets, channels=list(channels))
        counts: dict[int, Sequence[int]] = reply["counts"]
        return counts

    def chunks_with(self, channels: Collection[int]) -> Sequence[int]:
        chunk_indexes: list[int] = self._request("pieces_of", channels=list(channels))["pieces"]
        return chunk_indexes

    def close(self) -> None:
        if not self._is_closed:
            with suppress(RecordingError, ClosedError):
                self._request("close")
            self._is_closed = True


def _clamp_time(at_ns: int | None) -> int | None:
    # Clamped to the range of msgpack.
    return None if at_ns is None else max(-(2**63), min(at_ns, 2**64 - 1))
