"""Process that reads recordings for another program: `python -m nep.recordings.apart.reader_process`.

Recordings may be untrusted, so Studio reads them in this process, whose memory is limited and which can be
killed at any time. Requests are frames (`nep.recordings.apart.frames`) on standard input, executed one at a
time. The reply to a request is any number of progress frames and one reply frame.
"""

from __future__ import annotations

import argparse
import sys
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import count, islice
from pathlib import Path
from typing import IO, Any

from nep.errors import NepError, RecordingError, RecordingTooLargeError
from nep.i18n import _, set_initial_language
from nep.recordings.apart.frames import (
    corruption_to_plain,
    file_info_to_plain,
    pack_messages,
    read_frame,
    write_frame,
)
from nep.recordings.file_reader import FileReader
from nep.recordings.formats.limits import ReadBudget
from nep.recordings.formats.records import RawMessage

_MAX_CURSORS = 32
_BATCH_BYTES = 1_000_000
_MAX_BATCH_MESSAGES = 4_096
Reply = Mapping[str, object]


class RecordingService:
    """Executor of the requests of another process.

    Args:
        report_progress: Called with the content of progress frames.
    """

    def __init__(self, report_progress: Callable[[Reply], object]) -> None:
        self._report_progress = report_progress
        self._files: dict[int, FileReader] = {}
        self._numbers = count(1)
        self._reported_damage: dict[int, int] = {}
        self._cursors: OrderedDict[int, Iterator[RawMessage]] = OrderedDict()
        self._operations: Mapping[str, Callable[[Mapping[str, Any]], Reply]] = {
            "open": self._open,
            "raw": self._read_raw,
            "next": self._next,
            "newest": self._newest,
            "newest_times": self._newest_times,
            "densities": self._densities,
            "pieces_of": self._chunks_with,
            "close": self._close,
        }

    def reply(self, request: Mapping[str, Any]) -> Reply:
        """Execute a request and return the reply. Errors are returned in the reply, not raised."""
        path = str(request.get("path", ""))
        try:
            reply = dict(self._operations[request["op"]](request))
        except RecordingError as error:
            return {
                "error": error.reason,
                "path": error.path,
                "is_too_large": isinstance(error, RecordingTooLargeError),
            }
        except MemoryError:
            return {"error": _("reading the file takes too much memory"), "path": path, "is_too_large": True}
        except NepError as error:
            return {"error": str(error), "path": path}
        except (TypeError, ValueError, KeyError, OSError) as error:
            return {"error": str(error) or type(error).__name__, "path": path}
        self._add_corruption(reply, request.get("file", reply.get("file")))
        return reply

    def _add_corruption(self, reply: dict[str, object], number: object) -> None:
        # Adds the damage of a file if it has grown since the last reply.
        file = self._files.get(number) if isinstance(number, int) else None
        if file is None or not isinstance(number, int):
            return
        damage = file.corruption
        if len(damage) != self._reported_damage.get(number, 0):
            self._reported_damage[number] = len(damage)
            reply["damage"] = corruption_to_plain(damage)

    def _open(self, request: Mapping[str, Any]) -> Reply:
        path = Path(request["path"])
        budget = None if request["budget"] is None else ReadBudget(path, *request["budget"])

        def progress(done: int, total: int) -> None:
            self._report_progress({"progress": (done, total)})

        file = FileReader(path, cache_bytes=request["cache_bytes"], progress=progress, budget=budget)
        number = next(self._numbers)
        self._files[number] = file
        return {"file": number, "facts": file_info_to_plain(file.info)}

    def _read_raw(self, request: Mapping[str, Any]) -> Reply:
        chunk_indexes = None if request["pieces"] is None else set(request["pieces"])
        file = self._files[request["file"]]
        number = next(self._numbers)
        self._cursors[number] = file.read_raw(
            request["start_ns"], request["end_ns"], set(request["channels"]), chunk_indexes
        )
        while len(self._cursors) > _MAX_CURSORS:
            self._cursors.popitem(last=False)
        return self._next({"cursor": number, "most": request["most"]})

    def _next(self, request: Mapping[str, Any]) -> Reply:
        # The cursor is 0 after the last message.
        number = request["cursor"]
        if number not in self._cursors:
            raise ValueError(_("too many readers of the recording at the same time; try again later"))
        self._cursors.move_to_end(number)
        cursor, batch, size = self._cursors[number], list[RawMessage](), 0
        for raw in islice(cursor, min(request["most"], _MAX_BATCH_MESSAGES)):
            batch.append(raw)
            size += raw.data.nbytes
            if size >= _BATCH_BYTES:
                break
        if not batch:
            del self._cursors[number]
            number = 0
        return {"cursor": number, "messages": pack_messages(batch)}

    def _newest(self, request: Mapping[str, Any]) -> Reply:
        messages = self._files[request["file"]].newest(request["at_ns"], request["groups"])
        return {
            "are_there": [each is not None for each in messages],
            "messages": pack_messages(each for each in messages if each is not None),
        }

    def _newest_times(self, request: Mapping[str, Any]) -> Reply:
        return {"times": self._files[request["file"]].newest_times(request["at_ns"], request["channels"])}

    def _densities(self, request: Mapping[str, Any]) -> Reply:
        file, channels = self._files[request["file"]], set(request["channels"])
        return {
            "counts": file.densities(request["start_ns"], request["end_ns"], request["buckets"], channels)
        }

    def _chunks_with(self, request: Mapping[str, Any]) -> Reply:
        return {"pieces": self._files[request["file"]].chunks_with(request["channels"])}

    def _close(self, request: Mapping[str, Any]) -> Reply:
        file = self._files.pop(request["file"], None)
        if file is not None:
            file.close()
        return {}


def _limit_memory(limit_mb: int) -> None:
    # Only where the system supports it; elsewhere only the reader's own limits apply.
    try:
        import resource  # noqa: PLC0415 - not on Windows
    except ImportError:
        return
    with suppress(OSError, ValueError):
        resource.setrlimit(resource.RLIMIT_AS, (limit_mb * 2**20, limit_mb * 2**20))


def serve(requests: IO[bytes], replies: IO[bytes]) -> None:
    """Execute requests until the input stream ends.

    Args:
        requests: Stream of request frames.
        replies: Stream to which progress and reply frames are written.
    """
    service = RecordingService(lambda content: write_frame(replies, content))
    while (request := read_frame(requests)) is not None:
        write_frame(replies, service.reply(request))


def main(arguments: list[str] | None = None) -> None:
    """Run the process: execute requests from standard input until the input ends."""
    parser = argparse.ArgumentParser(prog="nep.recordings.apart.reader_process")
    parser.add_argument("--memory-mb", type=int, default=1024)
    _limit_memory(parser.parse_args(arguments).memory_mb)
    set_initial_language()
    with suppress(OSError, KeyboardInterrupt):  # the parent process has ended
        serve(sys.stdin.buffer, sys.stdout.buffer)


if __name__ == "__main__":
    main()
