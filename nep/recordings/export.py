"""Export of recordings: values as CSV or Parquet, images as files or video, parts as MCAP.

The result is one file (or folder of images) per topic, or one MCAP file with all topics. Existing files are
not overwritten, and incomplete files are removed. Messages that can't be decoded are skipped and counted.
"""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from nep.errors import DecodeError, RecordingError, RecordingsUnavailableError
from nep.i18n import _
from nep.messages.codecs import CODECS, content_of
from nep.messages.message import Message
from nep.recordings.copy_part import copy_part
from nep.recordings.film import Container, VideoFile, available_container, decode_frame
from nep.recordings.formats.destination import disk_error
from nep.recordings.reader import RecordedMessage, Recording
from nep.system.replace_file import replace_file

FORMATS = ("csv", "parquet", "pictures", "mp4", "mcap")
MAX_COLUMNS = 5_000
MAX_FILES = 1_000
"""Maximum number of exported files, of which there is one per topic."""
_MAX_LIST_COLUMNS = 100
"""Maximum length of a list whose items have separate columns. A longer list is one column of JSON."""
_MAX_DEPTH = 20
_CELLS_PER_BATCH = 200_000
_FIRST_COLUMNS = ("time_ns", "time_s", "stamp_ns", "stamp_s", "seq", "publisher")
_FPS = 30.0
_SUFFIXES = {"csv": ".csv", "parquet": ".parquet", "pictures": ""}
Progress = Callable[[int, int], object]


@dataclass(frozen=True)
class Part:
    """Part of a recording.

    Attributes:
        start_ns: Start in ns since 1970 (inclusive); None for no limit.
        end_ns: End in ns since 1970 (exclusive); None for no limit.
        topics: Names of topics; None for all topics that the format supports.
    """

    start_ns: int | None = None
    end_ns: int | None = None
    topics: Collection[str] | None = None


FULL_RECORDING = Part()


@dataclass(frozen=True)
class ExportedFile:
    """Exported file or folder.

    Attributes:
        topic: Name of the topic; "" for a file with all topics.
        path: Path of the file or folder.
        count: Number of exported messages.
        undecodable_count: Number of messages that were skipped because they can't be decoded.
    """

    topic: str
    path: Path
    count: int
    undecodable_count: int


def export(
    recording: Recording,
    kind: str,
    folder: Path,
    part: Part = FULL_RECORDING,
    *,
    fps: float = _FPS,
    progress: Progress | None = None,
) -> list[ExportedFile]:
    """Export a recording to files in a folder, which is created if needed.

    A video is written as .avi if this computer can't write MP4.

    Args:
        recording: Recording to export.
        kind: One of `FORMATS`.
        folder: Target folder.
        part: Part of the recording.
        fps: Frame rate of videos in Hz.
        progress: Called with the number of messages done and in total.

    Returns:
        The exported files.

    Raises:
        RecordingError: No topic is suitable, the part has no messages, there are too many topics or
            fields, a file already exists, or a file can't be written.
        RecordingsUnavailableError: A package is not installed.
        ValueError: The format is unknown.
    """
    if kind not in FORMATS:
        raise ValueError(_("unknown format '{kind}'").format(kind=kind))
    topics, export_progress = _exportable_topics(recording, kind, part, progress)
    if kind == "mcap":
        return [_write_mcap(recording, folder, replace(part, topics=topics), export_progress)]
    write_file: Callable[[_Source, Path, float], int]
    exported, used_names = [], set[str]()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        if kind == "mp4":
            container = available_container(_import_opencv(), folder)
            write_file, suffix = partial(_write_video, container=container), container.suffix
        else:
            write_file, suffix = (
                {"csv": _write_csv, "parquet": _write_parquet, "pictures": _write_pictures}[kind],
                _SUFFIXES[kind],
            )
        for topic in topics:
            path = folder / _file_name(topic, used_names, suffix)
            if path.exists():
                raise RecordingError(str(path), _("the file already exists; choose another name"))
            part_path = path.with_name(f"{path.name}.part")
            source = _Source(recording, topic, part, export_progress)
            try:
                count = write_file(source, part_path, fps)
                replace_file(part_path, path)
            except BaseException:
                _remove(part_path)
                raise
            exported.append(ExportedFile(topic, path, count, source.undecodable_count))
    except OSError as error:
        raise disk_error(folder, error) from error
    return exported


def can_export(kind: str, codec: str) -> bool:
    """Return True if a format supports messages of a codec.

    Args:
        kind: One of `FORMATS`.
        codec: Name of the codec.
    """
    content = content_of(codec) if codec in CODECS else ""
    if kind in {"pictures", "mp4"}:
        return content == "image"
    return kind == "mcap" or content in {"values", "text"}


def _exportable_topics(
    recording: Recording, kind: str, part: Part, progress: Progress | None
) -> tuple[list[str], _Progress]:
    # Suitable topics that have messages. Raises `RecordingError`.
    topics = [
        name
        for name, each in recording.topics.items()
        if (part.topics is None or name in part.topics) and can_export(kind, each.codec)
    ]
    if not topics:
        reason = {
            "mcap": _("the selected topics aren't in the recording"),
            "pictures": _("no topic has images"),
            "mp4": _("no topic has images"),
        }.get(kind, _("no topic has values for a table"))
        raise RecordingError(str(recording.path), reason)
    if kind != "mcap" and len(topics) > MAX_FILES:
        template = _("the recording has {count} suitable topics; choose at most {most}")
        raise RecordingError(str(recording.path), template.format(count=len(topics), most=MAX_FILES))
    counts = _estimate_counts(recording, topics, part)
    if kind != "mcap":
        topics = [name for name in topics if counts.get(name)]
    if not any(counts.values()):
        is_full_recording = part.start_ns is None and part.end_ns is None
        reason = (
            _("no message can be decoded")
            if is_full_recording
            else _("there are no messages in the selected part")
        )
        raise RecordingError(str(recording.path), reason)
    return topics, _Progress(sum(counts.values()), progress)


def _estimate_counts(recording: Recording, topics: list[str], part: Part) -> dict[str, int]:
    # Estimated from indexes, without reading messages; at least 1 for a topic with messages.
    if part.start_ns is None and part.end_ns is None:
        return {name: recording.topics[name].message_count for name in topics}
    start_ns = recording.start_ns if part.start_ns is None else part.start_ns
    end_ns = recording.end_ns + 1 if part.end_ns is None else part.end_ns
    densities = recording.densities(start_ns, end_ns, 1, topics)
    counts = {}
    for name in topics:
        first_message = next(recording.read(start_ns, end_ns, (name,)), None) if start_ns < end_ns else None
        counts[name] = max(1, sum(densities.get(name, ()))) if first_message is not None else 0
    return counts


def _remove(path: Path) -> None:
    with suppress(OSError):
        if path.is_dir():
            for child in path.iterdir():
                child.unlink()
            path.rmdir()
        else:
            path.unlink(missing_ok=True)


def _file_name(topic: str, used_names: set[str], suffix: str) -> str:
    # Valid on every operating system, and unique.
    safe_name = re.sub(r"[^\w.-]+", "_", topic).strip("._") or "topic"
    name, number = safe_name[:100], 2
    while name.lower() in used_names:
        name, number = f"{safe_name[:100]}-{number}", number + 1
    used_names.add(name.lower())
    return name + suffix


class _Progress:
    """Progress of an export over all its files."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self._total, self._progress = total, progress
        self._done_count = 0

    def add(self) -> None:
        self._done_count += 1
        if self._progress is not None and (self._done_count % 100 == 0 or self._done_count >= self._total):
            self._progress(min(self._done_count, self._total), self._total)


class _Source:
    """Messages of one topic in the part that is exported."""

    def __init__(self, recording: Recording, topic: str, part: Part, export_progress: _Progress) -> None:
        self._recording, self.topic, self._part, self._progress = recording, topic, part, export_progress
        self.undecodable_count = 0

    def messages(self, *, reports_progress: bool = True) -> Iterator[RecordedMessage]:
        for record in self._recording.read(self._part.start_ns, self._part.end_ns, (self.topic,)):
            if reports_progress:
                self._progress.add()
            yield record

    def rows(self, *, reports_progress: bool = True) -> Iterator[dict[str, object]]:
        # Flat values with the times first; a field of the payload with the same name becomes "payload.seq".
        self.undecodable_count = 0
        for record in self.messages(reports_progress=reports_progress):
            try:
                values = flatten(record.message.payload)
            except (DecodeError, RecursionError):
                self.undecodable_count += 1
                continue
            row = _time_columns(record)
            for name, value in values.items():
                column = _escape_surrogates(name) if name not in row else f"payload.{name}"
                row[column] = _escape_surrogates(value) if isinstance(value, str) else value
            yield row


def _time_columns(record: RecordedMessage) -> dict[str, object]:
    message = record.message
    return {
        "time_ns": record.log_ns,
        "time_s": record.log_ns / 1e9,
        "stamp_ns": message.stamp_ns,
        "stamp_s": None if message.stamp_ns is None else message.stamp_ns / 1e9,
        "seq": message.seq,
        "publisher": None if message.publisher is None else str(message.publisher),
    }


def _escape_surrogates(text: str) -> str:
    # JSON may contain lone surrogates, which can't be encoded.
    return text if text.isascii() else text.encode("utf-8", "backslashreplace").decode("utf-8")


def flatten(payload: object) -> dict[str, object]:
    """Return the scalar values of a payload by field path, such as "pose.x" or "joints[3]".

    A payload that is a scalar itself has the path "value".
    """
    columns: dict[str, object] = {}
    _flatten(payload, "", columns, _MAX_DEPTH)
    return columns


def _flatten(value: object, path: str, columns: dict[str, object], depth: int) -> None:
    if isinstance(value, Mapping) and value and depth > 0:
        for key, item in value.items():
            _flatten(item, f"{path}.{key}" if path else str(key), columns, depth - 1)
    elif isinstance(value, list | tuple) and 0 < len(value) <= _MAX_LIST_COLUMNS and depth > 0:
        for number, item in enumerate(value):
            _flatten(item, f"{path}[{number}]", columns, depth - 1)
    elif value is None or isinstance(value, bool | int | float | str):
        columns[path or "value"] = value
    else:
        try:
            columns[path or "value"] = json.dumps(value, default=str, ensure_ascii=False)
        except TypeError:  # keys of msgpack may be bytes
            columns[path or "value"] = str(value)


def _columns(source: _Source) -> dict[str, set[type]]:
    # Columns with their value types. Raises `RecordingError` for too many.
    columns: dict[str, set[type]] = {name: set() for name in _FIRST_COLUMNS}
    for row in source.rows(reports_progress=False):
        for name, value in row.items():
            columns.setdefault(name, set())
            if value is not None:
                columns[name].add(type(value))
        if len(columns) > MAX_COLUMNS:
            raise RecordingError(
                source.topic,
                _("the messages have more than {most} different fields").format(most=MAX_COLUMNS),
            )
    return columns


# ---- MCAP


def _write_mcap(recording: Recording, folder: Path, part: Part, export_progress: _Progress) -> ExportedFile:
    # Copies bytes, sequence numbers, times, and the recorder's own entries. Raises `RecordingError`.
    path = folder / f"{recording.path.stem}.mcap"
    part_path = path.with_name(f"{path.name}.part")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise disk_error(folder, error) from error
    if path.exists():
        raise RecordingError(str(path), _("the file already exists; choose another name"))
    try:
        span = (part.start_ns, part.end_ns)
        count = copy_part(recording, part_path, span, part.topics or (), export_progress.add)
        replace_file(part_path, path)
    except BaseException as error:
        _remove(part_path)
        if isinstance(error, OSError):
            raise disk_error(path, error) from error
        raise
    return ExportedFile("", path, count, 0)


# ---- tables


def _write_csv(source: _Source, path: Path, _fps: float) -> int:
    columns = list(_columns(source))
    count = 0
    with path.open("x", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, columns)
        writer.writeheader()
        for row in source.rows():
            writer.writerow({name: _format_cell(value) for name, value in row.items()})
            count += 1
    return count


def _format_cell(value: object) -> object:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value)
    return value


def _write_parquet(source: _Source, path: Path, _fps: float) -> int:
    try:
        import pyarrow as pa  # type: ignore[import-untyped]  # noqa: PLC0415 - optional and heavy
        import pyarrow.parquet as pq  # type: ignore[import-untyped]  # noqa: PLC0415
    except ImportError as error:
        raise RecordingsUnavailableError("pip install 'nep-studio[parquet]'") from error
    columns = _columns(source)
    column_types = {name: _column_type(name, types) for name, types in columns.items()}
    arrow_types = {
        "bool": pa.bool_(),
        "int": pa.int64(),
        "uint": pa.uint64(),
        "float": pa.float64(),
        "text": pa.string(),
    }
    schema = pa.schema([(name, arrow_types[kind]) for name, kind in column_types.items()])
    count, rows_per_batch = 0, max(1, _CELLS_PER_BATCH // len(columns))
    with pq.ParquetWriter(path, schema) as writer:
        rows: list[dict[str, object]] = []

        def write() -> None:
            table = {
                name: [_convert(column_types[name], row.get(name)) for row in rows] for name in column_types
            }
            writer.write_table(pa.table(table, schema=schema))
            rows.clear()

        for row in source.rows():
            rows.append(row)
            count += 1
            if len(rows) >= rows_per_batch:
                write()
        if rows:
            write()
    return count


def _column_type(name: str, types: set[type]) -> str:
    if name == "seq":
        return "uint"
    if types == {bool}:
        return "bool"
    if types == {int}:
        return "int"
    if types and types <= {int, float}:
        return "float"
    return "text"


def _convert(kind: str, value: object) -> object:
    # Values that don't fit, such as ints beyond 64 bits, are left out.
    if value is None:
        return None
    if kind == "text":
        return value if isinstance(value, str) else json.dumps(value)
    if kind == "float":
        with suppress(OverflowError):
            return float(value)  # type: ignore[arg-type]
        return None
    if kind == "int":
        return value if isinstance(value, int) and -(2**63) <= value < 2**63 else None
    return value


# ---- images


def _write_pictures(source: _Source, path: Path, _fps: float) -> int:
    # JPEG and PNG files unchanged; raw images as PNG, or raw where PNG lacks the number type.
    path.mkdir()
    count = 0
    for record in source.messages():
        picture = _picture_file(record.message)
        if picture is None:
            source.undecodable_count += 1
            continue
        suffix, data = picture
        count += 1
        (path / f"{count:06d}.{suffix}").write_bytes(data)
    return count


def _picture_file(message: Message) -> tuple[str, bytes] | None:
    data = bytes(message.data)
    if data.startswith(b"\xff\xd8\xff"):
        return "jpg", data
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return "png", data
    try:
        frame: Any = message.payload
    except DecodeError:
        return None
    opencv = _import_opencv()
    try:
        is_encoded, buffer = opencv.imencode(".png", frame)
    except opencv.error:
        is_encoded, buffer = False, None
    return ("png", buffer.tobytes()) if is_encoded else ("raw", data)


def _import_opencv() -> Any:  # noqa: ANN401 - a module
    try:
        import cv2  # noqa: PLC0415 - optional and heavy
    except ImportError as error:
        raise RecordingsUnavailableError("pip install 'nep-studio[image]'") from error
    return cv2


def _write_video(source: _Source, path: Path, fps: float, container: Container) -> int:
    # Constant frame rate in recording time: each frame is the newest image.
    opencv = _import_opencv()
    video = VideoFile(opencv, path, fps, container)
    count = 0
    try:
        for record in source.messages():
            frame = decode_frame(opencv, record.message)
            if frame is None:
                source.undecodable_count += 1
                continue
            video.add(record.log_ns, frame)
            count += 1
        video.finish()
    finally:
        video.remove()
    if not count:
        raise RecordingError(str(path), _("none of the images can be read"))
    return count
