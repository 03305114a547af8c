"""Benchmark of recording: nep's recorder and flight recorder, mcap's writer, a naive thread, a plain file.

    python3 dev.py bench recorder                              images and small messages; a file of 1 GB
    python3 dev.py bench recorder -- --gigabytes 10 --blocks 9 the file size of the goal

Each variant writes the same messages in this process, as fast as it can, until all are in its file.
The variants are interleaved in random order. A run counts only if two plain series differ by at most
5 %.

    plain           the same bytes to a file, 1 MB at a time
    naive           a thread that takes each message from a queue and writes it
    mcap            the writer of the package `mcap`: no queue, no statistics, no checks
    nep             `RecordingWriter`: queue, thread, statistics, every JSON payload validated
    ring            `FlightRecorder` of 200 MB

Then the paced load of the goal for some seconds: 100 MB/s of images and 20 000 small messages per
second at once. Last, a file of the given size in gigabytes is opened, and 50 random times are sought
in it.
"""

from __future__ import annotations

import argparse
import json
import queue
import random
import shutil
import struct
import tempfile
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

from blocks import Sample, cpu_s, interleaved, verdict
from mcap.writer import Writer

from nep.messages.clocks import OWN_CLOCK
from nep.messages.message import Message, message_kind, received_message
from nep.recordings.file_reader import FileReader
from nep.recordings.formats.destination import WriterLimits
from nep.recordings.formats.mcap_file import FileWriter
from nep.recordings.formats.records import ChunkInfo
from nep.recordings.reader import Recording
from nep.recordings.ring import FlightRecorder
from nep.recordings.writer import RecordingWriter

PICTURE_BYTES = 200_000
LIMITS = WriterLimits(queue_bytes=2_000_000_000, queue_messages=2_000_000, min_free_bytes=0)


def pictures(count: int) -> list[Message]:
    """Return messages as a camera sends them: incompressible bytes with the head of a JPEG."""
    kind = message_kind("/camera", "image", "image", clock=OWN_CLOCK)
    rnd = random.Random(1)
    data = [b"\xff\xd8\xff\xda\x00\x02" + rnd.randbytes(PICTURE_BYTES) for _each in range(20)]
    extension = {"shape": [480, 640, 3], "encoding": "jpeg"}
    return [
        received_message(kind, data[at % 20], time.time_ns(), at + 1, 7, extension) for at in range(count)
    ]


def states(count: int, topics: int = 20) -> list[Message]:
    """Return messages as robot arms send them: 600 bytes of JSON."""
    kinds = [message_kind(f"/arm{number}/state", "json", "json", clock=OWN_CLOCK) for number in range(topics)]
    rnd = random.Random(2)
    data = [
        json.dumps({"joints": [rnd.gauss(0, 1) for _each in range(28)], "name": "arm"}).encode()
        for _each in range(50)
    ]
    return [
        received_message(kinds[at % topics], data[at % 50], time.time_ns(), at // topics + 1, at % topics)
        for at in range(count)
    ]


def timed(write: Callable[[], object], count: int) -> Sample:
    """Return the time per message."""
    started, used = time.perf_counter(), cpu_s()
    write()
    return Sample((time.perf_counter() - started) / count, (cpu_s() - used) / count)


class Ways:
    """Variants that write the same messages to a folder."""

    def __init__(self, folder: Path, messages: Sequence[Message]) -> None:
        self._folder, self._messages = folder, messages

    def _path(self, name: str) -> Path:
        path = self._folder / name
        path.unlink(missing_ok=True)
        return path

    def plain(self) -> None:
        """Write the bytes to a file, 1 MB at a time."""
        with self._path("plain").open("wb", buffering=1_000_000) as file:
            for each in self._messages:
                file.write(each.data)

    def naive(self) -> None:
        """Write each message on its own, in a thread with a queue."""
        waiting: queue.Queue[Message | None] = queue.Queue()

        def write() -> None:
            with self._path("naive").open("wb", buffering=0) as file:
                while (each := waiting.get()) is not None:
                    head = struct.pack("<QI", each.stamp_ns or 0, each.size_bytes)
                    file.write(head + each.topic.encode() + bytes(each.data))

        thread = threading.Thread(target=write)
        thread.start()
        for each in self._messages:
            waiting.put(each)
        waiting.put(None)
        thread.join()

    def mcap(self) -> None:
        """Write with the package `mcap`."""
        with self._path("mcap.mcap").open("wb") as file:
            writer = Writer(file)
            writer.start()
            channels: dict[str, int] = {}
            for each in self._messages:
                if each.topic not in channels:
                    channels[each.topic] = writer.register_channel(each.topic, "json", 0)
                stamp = each.stamp_ns or 0
                writer.add_message(channels[each.topic], stamp, each.data, stamp, each.seq or 0)
            writer.finish()

    def nep(self) -> None:
        """Write with nep's recorder; exit if messages are missing."""
        with RecordingWriter(self._path("nep.mcap"), limits=LIMITS) as writer:
            self._post(writer.post)
        if writer.status.message_count != len(self._messages):
            raise SystemExit(f"messages are missing: {writer.status}")

    def ring(self) -> None:
        """Write to a flight recorder of 200 MB."""
        with FlightRecorder(self._folder / "ring", size_bytes=200_000_000, limits=LIMITS) as ring:
            self._post(ring.post)
            ring._writer.flush(60.0)  # noqa: SLF001 - the end of the work, before its files are removed

    def _post(self, post: Callable[[Sequence[Message]], object]) -> None:
        for at in range(0, len(self._messages), 50):
            post(self._messages[at : at + 50])


def compare(name: str, messages: Sequence[Message], folder: Path, blocks: int) -> float:
    """Print the table for one kind of messages; return the ratio of the two plain series."""
    ways = Ways(folder, messages)
    count, size = len(messages), sum(each.size_bytes for each in messages)
    variants = {
        "plain": partial(timed, ways.plain, count),
        "plain again": partial(timed, ways.plain, count),
        "naive": partial(timed, ways.naive, count),
        "mcap": partial(timed, ways.mcap, count),
        "nep": partial(timed, ways.nep, count),
        "ring": partial(timed, ways.ring, count),
    }
    found = interleaved(variants, blocks, limit=2)
    plain = found["plain"]
    print(f"\n{name}: {count} messages, {size / 1e6:.0f} MB")
    print("| way | messages/s | MB/s | ÷ plain | MB for a second of processor |")
    print("|---|---|---|---|---|")
    for way, each in found.items():
        print(
            f"| {way} | {1 / each.seconds:.0f} | {size / count / each.seconds / 1e6:.0f} "
            f"| {each.seconds / plain.seconds:.2f} | {size / count / each.cpu_s / 1e6:.0f} |"
        )
    return found["plain again"].seconds / plain.seconds


def paced(folder: Path, seconds: float) -> bool:
    """Record 100 MB/s of images and 20 000 small messages per second; return True if nothing was lost."""
    path = folder / "paced.mcap"
    camera, arms = pictures(int(500 * seconds)), states(int(20_000 * seconds))
    never, step_s = threading.Event(), 0.01
    used, started = cpu_s(), time.perf_counter()
    with RecordingWriter(path, limits=WriterLimits(min_free_bytes=0)) as writer:
        most_queued = 0
        for step in range(int(seconds / step_s)):
            writer.post(camera[step * 5 : step * 5 + 5])
            writer.post(arms[step * 200 : step * 200 + 200])
            most_queued = max(most_queued, writer.status.queued_bytes)
            never.wait(max(0.0, started + (step + 1) * step_s - time.perf_counter()))
        posted_s = time.perf_counter() - started
    took = time.perf_counter() - started
    status = writer.status
    share, given = (cpu_s() - used) / took, sum(each.size_bytes for each in (*camera, *arms)) / 1e6
    print(
        f"\npaced, {took:.1f} s: {status.message_count} of {len(camera) + len(arms)} messages, "
        f"{given / posted_s:.0f} MB/s given, {status.size_bytes / 1e6:.0f} MB written, "
        f"unkept {status.unkept}, most queued {most_queued / 1e6:.1f} MB, {share:.0%} of a core"
    )
    path.unlink()
    return status.unkept == 0 and status.message_count == len(camera) + len(arms)


def large_file(folder: Path, gigabytes: float) -> bool:
    """Return True if a file of this size opens within 0.5 s and each seek takes at most 50 ms."""
    path = folder / "large.mcap"
    made = folder / "one.mcap"
    with RecordingWriter(made, limits=LIMITS) as writer:
        for at in range(0, 1000, 5):
            writer.post(pictures(5))
            writer.post(states(at // 5 + 40)[at // 5 :])
    with closing(FileReader(made)) as small, made.open("rb") as file:
        large = FileWriter(path)
        for number, each in small.info.channels.items():
            large.table.add_with_id(number, each)
        chunks = small.chunks()
        shift = 0
        while large.size_bytes < gigabytes * 1e9:
            for chunk in chunks:
                file.seek(chunk.offset)
                head = bytearray(file.read(chunk.length))
                index = file.read(chunk.index_bytes)
                struct.pack_into("<QQ", head, 9, chunk.start_ns + shift, chunk.end_ns + shift)
                large.copy_chunk(bytes(head), _later(chunk, shift), _indexes(index, shift))
            shift += small.info.end_ns - small.info.start_ns + 1_000_000
        large.finish()
    started = time.perf_counter()
    recording = Recording(path)
    opened = time.perf_counter() - started
    rnd, sought = random.Random(3), []
    for _each in range(50):
        at = rnd.randrange(recording.start_ns, recording.end_ns)
        started = time.perf_counter()
        recording.newest(at)
        sought.append(time.perf_counter() - started)
    started = time.perf_counter()
    recording.densities(recording.start_ns, recording.end_ns, 1000)
    counted = time.perf_counter() - started
    size, topics = path.stat().st_size, len(recording.topics)
    recording.close()
    with closing(FileReader(path)) as raw:
        count = len(raw.chunks())
    path.unlink()
    sought.sort()
    print(
        f"\n{size / 1e9:.1f} GB, {count} chunks, {topics} topics: opened in {opened * 1e3:.0f} ms; sought in "
        f"{sought[25] * 1e3:.1f} ms, the slowest of 50 in {sought[-1] * 1e3:.1f} ms; densities of all of it "
        f"in {counted * 1e3:.0f} ms"
    )
    return opened <= 0.5 and sought[-1] <= 0.05


def _later(chunk: ChunkInfo, shift: int) -> ChunkInfo:
    return replace(chunk, start_ns=chunk.start_ns + shift, end_ns=chunk.end_ns + shift)


def _indexes(data: bytes, shift: int) -> dict[int, bytes]:
    """Return message indexes shifted in time.

    The times in the messages themselves stay the same, because nothing in this benchmark reads them.
    """
    made, at = {}, 0
    while at < len(data):
        length = 9 + int.from_bytes(data[at + 1 : at + 9], "little")
        channel, size = struct.unpack_from("<HI", data, at + 9)
        numbers = list(struct.unpack_from(f"<{size // 8}Q", data, at + 15))
        numbers[::2] = [each + shift for each in numbers[::2]]
        made[channel] = data[at : at + 15] + struct.pack(f"<{size // 8}Q", *numbers)
        at += length
    return made


def main() -> int:
    """Run the benchmark; return 0 if it counts and the goals were reached."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--blocks", type=int, default=5, help="rounds of each comparison")
    parser.add_argument("--seconds", type=float, default=5.0, help="of the paced load")
    parser.add_argument("--gigabytes", type=float, default=1.0, help="of the large file")
    parser.add_argument("--folder", type=Path, default=None, help="on the disk that is meant")
    given = parser.parse_args()
    folder = Path(tempfile.mkdtemp(prefix="nep-recorder-", dir=given.folder))
    try:
        again = compare("pictures", pictures(1500), folder, given.blocks)
        again_small = compare("small messages", states(60_000), folder, given.blocks)
        is_kept = paced(folder, given.seconds)
        is_quick = large_file(folder, given.gigabytes)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    print(f"\nsmall messages, plain against itself: {again_small:.3f}")
    return verdict(again) or int(not (is_kept and is_quick))


if __name__ == "__main__":
    raise SystemExit(main())
