"""Tests of files that claim gigabytes or minutes: commands stay within their limits and end with an error."""

from __future__ import annotations

import json
import random
import subprocess
import sys
from pathlib import Path

import pytest

from nep.errors import RecordingError, RecordingTooLargeError
from nep.messages.message import Message
from nep.recordings.export import export
from nep.recordings.file_reader import FileReader
from nep.recordings.formats.damage import corruption_text
from nep.recordings.formats.index import read_index
from nep.recordings.formats.limits import ReadBudget, open_budget
from nep.recordings.reader import Recording
from nep.recordings.writer import RecordingWriter
from tests.nep.recordings import hostile
from tests.nep.recordings.messages import json_message, limits
from tests.nep.recordings.test_foreign import KINDS, written

LIMIT_MB = 256
_ALL_COMMANDS = """
import contextlib, io, json, resource, sys, time
from pathlib import Path
import nep.cli.app
resource.setrlimit(resource.RLIMIT_AS, (2**30, 2**30))
out = Path(sys.argv[1])
for path in map(Path, sys.argv[2:]):
    for number, words in enumerate((
        ("recording", "info", path),
        ("recording", "repair", path, "-o", out / f"{path.stem}.mcap"),
        ("recording", "export", path, "-o", out / path.stem),
        ("recording", "export", path, "-f", "mcap", "-o", out / path.stem),
        ("play", path, "/none*"),
    )):
        if number > 0 and "210 000" in path.stem:  # opening is all that differs
            continue
        sys.argv, said = ["nep", *map(str, words)], io.StringIO()
        began = time.process_time()
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            code = nep.cli.app.run()
        status = Path("/proc/self/status").read_text()  # ru_maxrss has what the parent used before exec
        mb = int(status.partition("VmHWM:")[2].split()[0]) // 1024
        words = said.getvalue().strip()
        print(json.dumps([path.stem, number, code, time.process_time() - began, mb, words[-500:]]))
"""


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return hostile.write_all(tmp_path_factory.mktemp("hostile"))


@pytest.mark.skipif(sys.platform != "linux", reason="/proc tells the most memory of a process")
def test_commands_use_bounded_memory_and_time_for_each_hostile_file(
    paths: list[Path], tmp_path: Path
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", _ALL_COMMANDS, str(tmp_path), *map(str, paths)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert {each[0] for each in told} == {path.stem for path in paths}
    for name, _number, code, cpu_s, mb, words in told:
        assert mb < LIMIT_MB, (name, mb)
        assert cpu_s < 5.0, (name, cpu_s)
        assert code == 0 or words, name
        assert "Traceback" not in words, name


@pytest.mark.parametrize(
    "name",
    [
        "zstd frame larger than its chunk states",
        "zstd frame without a size",
        "zstd frame that states 12 GB",
        "chunk that states 600 MB and has them",
        "lz4 frame larger than its chunk states",
        "lz4 chunk of 300 MB",
    ],
)
def test_decompression_bomb_in_a_chunk_is_reported_as_damage(paths: list[Path], name: str) -> None:
    (path,) = (each for each in paths if each.stem == name)
    with Recording(path) as recording:
        assert list(recording.read()) == []
        (damage,) = recording.corruption
        assert (damage.start_ns, damage.end_ns) == hostile.TIMES


def test_chunk_is_indexed_once_despite_repeated_summary_entries(paths: list[Path]) -> None:
    (path,) = (each for each in paths if each.stem.startswith("3 000 entries"))
    with FileReader(path) as reader:
        assert len(reader.chunks()) + len(reader.corruption) <= 1


def test_open_cost_is_bounded_by_the_file_size(paths: list[Path]) -> None:
    for path in paths:
        with path.open("rb") as file:
            budget = open_budget(path, path.stat().st_size)
            try:
                index = read_index(file, path, budget=budget)
            except RecordingError as error:
                assert error.reason  # noqa: PT017 - either is right
            else:
                assert len(index.chunks) <= 1000


def test_read_budget_limits_bytes_and_seconds(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(hostile.closed(hostile.channel() + hostile.chunk_of(hostile.message()) * 10))
    size = path.stat().st_size
    with FileReader(path, budget=ReadBudget(path, 100_000)) as reader:
        assert len(list(reader.read_raw(None, None, {1}))) == 10
    with pytest.raises(RecordingTooLargeError):
        FileReader(path, budget=ReadBudget(path, size // 2))
    clock = iter([0.0, *[2.0] * 100])
    with pytest.raises(RecordingTooLargeError):
        FileReader(path, budget=ReadBudget(path, 100_000, 1.0, lambda: next(clock)))


def test_all_messages_of_overlapping_chunks_are_read(paths: list[Path]) -> None:
    (path,) = (each for each in paths if each.stem == "all chunks at all times")
    with FileReader(path) as reader:
        assert sum(1 for _each in reader.read_raw(None, None, {1})) == 20_000


@pytest.mark.parametrize("kind", ["chunks", "no chunks", "no summary", "no message index"])
def test_damaged_bytes_raise_only_recording_errors(tmp_path: Path, kind: str) -> None:
    whole = written(tmp_path / "whole.mcap", **KINDS[kind]).read_bytes()
    rnd, path = random.Random(kind), tmp_path / "damaged.mcap"
    for number in range(60):
        made = bytearray(whole)
        if number % 4 == 0:
            del made[rnd.randrange(8, len(made)) :]
        for _flip in range(rnd.randint(1, 8)):
            made[rnd.randrange(len(made))] = rnd.choice((0, 1, 0x7F, 0x80, 0xFF, rnd.randrange(256)))
        path.write_bytes(made)
        try:
            with Recording(path) as recording:
                list(recording.read())
                recording.newest(recording.end_ns)
                recording.densities(0, 2**64 - 1, 5)
                recording.stats()
                assert corruption_text(recording.corruption, recording.start_ns) or not recording.corruption
        except RecordingError as error:
            assert error.reason  # noqa: PT017 - either is right


def test_writer_continues_after_messages_with_extreme_values(tmp_path: Path) -> None:
    deep = (b"[" * 1000 + b"]" * 1000, b'{"a":' * 1000 + b"1" + b"}" * 1000, b"\x91" * 1000 + b"\x01")
    odd = [
        Message("/odd", data, codec, kind, stamp_ns=stamp, seq=stamp, publisher=stamp, extension=extension)
        for data in (*deep, b"", b"\xff" * 9, b"[1e999, NaN, 18446744073709551616]", b'"\xed\xa0\x80"')
        for codec, kind in (("json", "json"), ("msgpack", "x"), ("image", "image"), ("string", "a" * 5000))
        for stamp, extension in ((2**64, {"shape": [2**70] * 9}), (-1, {"seq": "x", "a": [[[]]]}), (None, {}))
    ]
    with RecordingWriter(tmp_path / "a.mcap", limits=limits()) as writer:
        writer.post(odd)
        writer.post([json_message(1)])
        assert writer.flush()
        assert writer.status.message_count == len(odd) + 1
        assert not writer.problem
    with Recording(tmp_path / "a.mcap") as recording:
        assert len(list(recording.read())) == len(odd) + 1
        for kind in ("csv", "mcap"):
            assert export(recording, kind, tmp_path / kind)
