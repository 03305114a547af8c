"""`nep recording info`: show the content and the damage of a recording."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime, timezone
from itertools import islice
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.options import JsonOption
from nep.cli.recordings.recording_files import FileArgument, clock_text, exit_if_damaged, progress_bar
from nep.cli.screen import (
    UNKNOWN,
    TextColumn,
    format_rate,
    format_size,
    print_status,
    show_json,
    show_table,
    write,
)
from nep.i18n import _, format_list, lazy, ngettext
from nep.system.lazy_import import lazy_module
from nep.text import escaped, quotable

if TYPE_CHECKING:
    from nep.recordings import file_reader, reader
    from nep.recordings.formats import message_counts
else:  # imported on use: other commands stay fast and need no extra packages
    file_reader = lazy_module("nep.recordings.file_reader")
    reader = lazy_module("nep.recordings.reader")

_MAX_ROWS = 1_000
_MAX_VALUES = 20
_MAX_CHECKED_BYTES = 1_000_000_000
_OWN_METADATA = frozenset({"nep.recording", "nep.figures"})
_COLUMNS = (
    TextColumn(lazy("topic"), style="bold", is_folded_last=True),
    TextColumn(lazy("type")),
    TextColumn(lazy("encoding")),
    TextColumn(lazy("schema")),
    TextColumn(lazy("messages"), "right"),
    TextColumn(lazy("rate"), "right"),
    TextColumn(lazy("lost"), "right"),
    TextColumn(lazy("late"), "right"),
    TextColumn(lazy("unreadable"), "right"),
    TextColumn(lazy("write errors"), "right"),
)
_ATTACHMENT_COLUMNS = (
    TextColumn(lazy("attachment"), is_folded_last=True),
    TextColumn(lazy("type")),
    TextColumn(lazy("size"), "right"),
)


def info(
    file: FileArgument,
    check_all: Annotated[
        bool,
        typer.Option("--check", help=_("Check the whole file for damage, regardless of its size.")),
    ] = False,
    as_json: JsonOption = False,
) -> None:
    """Show the content of a recording: topics, message counts, losses and damage.

    The first GB of messages is checked for damage. Exits with 1 if the file is damaged.
    """
    source_file = file_reader.FileReader(file)
    with reader.Recording(file, file=source_file) as recording:
        topic_stats = recording.stats()
        with progress_bar(_("checking")) as progress:
            is_fully_checked = source_file.check(progress, None if check_all else _MAX_CHECKED_BYTES)
        if as_json:
            show_json(_to_plain(recording, topic_stats))
        else:
            _show(recording, topic_stats)
            if not is_fully_checked:
                message = _("only the first gigabyte was checked for damage; --check reads all of it")
                print_status(message)
        if not recording.is_complete:
            template = _(
                "the file is incomplete: it was truncated or not closed. Readable messages are "
                "shown; to repair it: nep recording repair {file}"
            )
            print_status(template.format(file=file))
        exit_if_damaged(recording)


def _show(recording: reader.Recording, topic_stats: Mapping[str, message_counts.TopicStats]) -> None:
    summary = _("{messages} messages in {time}, {size}, from {started}").format(
        messages=recording.message_count,
        time=clock_text(recording.duration_s),
        size=format_size(recording.size_bytes),
        started=_timestamp_text(recording.start_ns),
    )
    write(f"{summary}\n")
    if recording.recorder_metadata.get("note"):
        write(f"{escaped(recording.recorder_metadata['note'])}\n")
    if recording.recorder_metadata.get("part"):
        part = quotable(recording.recorder_metadata["part"])
        write(_("file {number} of a split recording").format(number=part) + "\n")
    write(f"{_writer_text(recording.info)}\n")
    topics = list(islice(recording.topics.values(), _MAX_ROWS))
    show_table(_COLUMNS, [_row(recording, each, topic_stats.get(each.name)) for each in topics])
    hidden_count = len(recording.topics) - len(topics)
    if hidden_count:
        template = ngettext(
            "and {count} more topic, which --json lists",
            "and {count} more topics, which --json lists",
            hidden_count,
        )
        write(f"{template.format(count=hidden_count)}\n")
    if recording.info.attachments:
        rows = [
            (quotable(each.name), quotable(each.media_type), format_size(each.size_bytes))
            for each in recording.info.attachments
        ]
        show_table(_ATTACHMENT_COLUMNS, rows)
    for line in _metadata_lines(recording.info):
        write(f"{line}\n")


def _writer_text(file_info: file_reader.FileInfo) -> str:
    chunk_texts = []
    for name, count in sorted(file_info.compressions.items()):
        if name == "-":
            chunk_texts.append(_("messages outside of chunks"))
        else:
            template = ngettext("{count} chunk {compression}", "{count} chunks {compression}", count)
            chunk_texts.append(template.format(count=count, compression=name or _("uncompressed")))
    parts = [quotable(file_info.library) or UNKNOWN]
    if file_info.profile:
        parts.append(_("profile {profile}").format(profile=quotable(file_info.profile)))
    return _("written by {program}; {chunks}").format(
        program=", ".join(parts), chunks=format_list(chunk_texts, "and") if chunk_texts else _("no messages")
    )


def _metadata_lines(file_info: file_reader.FileInfo) -> Iterator[str]:
    records = [each for each in file_info.metadata if each[0] not in _OWN_METADATA]
    for name, values in records[:_MAX_VALUES]:
        pairs = [f"{quotable(key)}: {quotable(value)}" for key, value in islice(values.items(), _MAX_VALUES)]
        more = "; …" if len(values) > _MAX_VALUES else ""
        yield _("metadata {name}: {values}").format(name=quotable(name), values="; ".join(pairs) + more)
    if len(records) > _MAX_VALUES:
        count = len(records) - _MAX_VALUES
        template = ngettext(
            "and {count} more metadata record, which --json lists",
            "and {count} more metadata records, which --json lists",
            count,
        )
        yield template.format(count=count)


def _timestamp_text(at_ns: int) -> str:
    try:
        moment = datetime.fromtimestamp(at_ns / 1e9, tz=timezone.utc).astimezone() if at_ns else None
    except (OSError, OverflowError, ValueError):  # out of range: written by another program
        moment = None
    return UNKNOWN if moment is None else moment.strftime("%Y-%m-%d %H:%M:%S")


def _row(
    recording: reader.Recording, topic: reader.RecordedTopic, topic_stats: message_counts.TopicStats | None
) -> tuple[str, ...]:
    duration = recording.duration_s
    return (
        escaped(topic.name),
        escaped(topic.msg_type),
        quotable(topic.encoding) or UNKNOWN,
        quotable(topic.schema_encoding) or UNKNOWN,
        str(topic.message_count),
        format_rate(topic.message_count / duration) if duration > 0 else UNKNOWN,
        UNKNOWN if topic_stats is None or topic_stats.lost is None else str(topic_stats.lost),
        UNKNOWN if topic_stats is None else str(topic_stats.late),
        UNKNOWN if topic_stats is None else str(topic_stats.undecodable),
        UNKNOWN if topic_stats is None else str(topic_stats.unkept),
    )


def _to_plain(
    recording: reader.Recording, topic_stats: Mapping[str, message_counts.TopicStats]
) -> dict[str, object]:
    file_info = recording.info
    return {
        "path": str(recording.path),
        "start_ns": recording.start_ns,
        "end_ns": recording.end_ns,
        "size_bytes": recording.size_bytes,
        "is_complete": recording.is_complete,
        "words": dict(recording.recorder_metadata),
        "library": file_info.library,
        "profile": file_info.profile,
        "compressions": dict(file_info.compressions),
        "attachments": [
            {"name": each.name, "media_type": each.media_type, "size_bytes": each.size_bytes}
            for each in file_info.attachments
        ],
        "metadata": [
            {"name": name, "values": dict(values)}
            for name, values in file_info.metadata
            if name not in _OWN_METADATA
        ],
        "damage": [
            {
                "start_ns": each.start_ns,
                "end_ns": each.end_ns,
                "offset": each.offset,
                "size_bytes": each.length,
                "message_count": each.message_count,
            }
            for each in recording.corruption
        ],
        "topics": {
            each.name: {
                "msg_type": each.msg_type,
                "codec": each.codec,
                "encoding": each.encoding,
                "schema_encoding": each.schema_encoding,
                "message_count": each.message_count,
                "figures": topic_stats[each.name].to_plain() if each.name in topic_stats else None,
            }
            for each in recording.topics.values()
        },
    }
