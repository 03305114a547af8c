"""`nep record`: record published messages to a file."""

from __future__ import annotations

import re
import threading
import time
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.complete import complete_topic
from nep.cli.network import open_command_node
from nep.cli.options import JsonOption, MasterOption
from nep.cli.recordings.recording_files import TopicsToRecordArgument, clock_text
from nep.cli.screen import console, format_size, print_status, show_json
from nep.errors import RecordingError
from nep.i18n import _, ngettext
from nep.system.lazy_import import lazy_module
from nep.text import quotable

if TYPE_CHECKING:
    from nep.recordings import recorder, writer
    from nep.recordings import split as splits
else:  # imported on use: other commands stay fast and need no extra packages
    recorder = lazy_module("nep.recordings.recorder")
    splits = lazy_module("nep.recordings.split")
    writer = lazy_module("nep.recordings.writer")

_STATUS_PERIOD_S = 0.2
_SIZE_PATTERN = re.compile(r"(\d{1,15}(?:[.,]\d{1,6})?) ?([kMGT]?)B?", re.IGNORECASE)
_UNIT_BYTES = {"": 1, "k": 10**3, "m": 10**6, "g": 10**9, "t": 10**12}


def record(
    topics: TopicsToRecordArgument = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE.mcap",
            help=_("File to write (default: named after the time)."),
            show_default=False,
            dir_okay=False,
        ),
    ] = None,
    excluded: Annotated[
        list[str] | None,
        typer.Option(
            "--not",
            metavar=_("TOPIC|PATTERN"),
            help=_("Topics to exclude, even if they match a pattern."),
            show_default=False,
            autocompletion=complete_topic,
        ),
    ] = None,
    note: Annotated[
        str,
        typer.Option(
            "--note", metavar=_("TEXT"), help=_("Note to store in the recording."), show_default=False
        ),
    ] = "",
    duration_s: Annotated[
        float | None,
        typer.Option("--duration", metavar=_("SECONDS"), help=_("Stop after this long."), show_default=False),
    ] = None,
    max_size: Annotated[
        str | None,
        typer.Option(
            "--max-size",
            metavar=_("SIZE"),
            help=_("Stop at this file size, such as 500MB or 2GB; with --split, start the next file."),
            show_default=False,
        ),
    ] = None,
    split: Annotated[
        bool,
        typer.Option("--split", help=_("Split into files: NAME-001.mcap, NAME-002.mcap, ...")),
    ] = False,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Record published messages to an MCAP file until Ctrl+C, SIGTERM or SIGHUP.

    Topics that appear later are recorded, too. A pattern stands for all matching topics: * for any characters
    between slashes, ? for one character, ** for any number of parts. Put it in quotes, because the shell
    expands patterns, too. Foxglove and Lichtblick can open the file; it includes the number of lost messages.
    """
    if duration_s is not None and not 0.0 < duration_s < 1e9:
        raise typer.BadParameter(
            _("{given:g} isn't a valid duration; use a number of seconds greater than 0").format(
                given=duration_s
            ),
            param_hint="--duration",
        )
    max_bytes = _parse_max_bytes(max_size, split=split)
    path = output or Path(datetime.now().astimezone().strftime("recording-%Y-%m-%d-%H-%M-%S.mcap"))
    selection = recorder.TopicSelection(tuple(topics or ()), tuple(excluded or ()))
    ended = threading.Event()
    with open_command_node("record", master) as node:
        node.graph()  # fail before creating a file if there is no master
        parts = splits.SplitFiles(path, max_bytes) if split and max_bytes is not None else None
        file = writer.RecordingWriter(parts or path, note=note, on_problem=lambda _reason: ended.set())
        try:
            with recorder.Recorder(node, file, selection):
                interrupts.call_on_signal(ended.set)
                if not as_json:
                    template = _("recording to '{path}'; press Ctrl+C to stop")
                    print_status(template.format(path=path if parts is None else parts.paths[0]))
                _wait(ended, file, duration_s, None if split else max_bytes)
        finally:
            status = file.close()
    _show_result([path] if parts is None else parts.paths, status, as_json=as_json)
    if status.problem:
        raise RecordingError(str(path), status.problem)


def _show_result(paths: Sequence[Path], status: writer.RecordingStatus, *, as_json: bool) -> None:
    if as_json:
        show_json(
            {
                "path": str(paths[0]),
                "paths": [str(each) for each in paths],
                "message_count": status.message_count,
                "size_bytes": status.size_bytes,
                "duration_s": status.duration_s,
                "topics": {topic: each.to_plain() for topic, each in status.topics.items()},
                "problem": status.problem,
            }
        )
        return
    _show_summary(paths[0], status)
    if len(paths) > 1:
        template = ngettext(
            "split into {count} file; the last is '{path}'",
            "split into {count} files; the last is '{path}'",
            len(paths),
        )
        print_status(template.format(count=len(paths), path=paths[-1]))


def _parse_max_bytes(text: str | None, *, split: bool) -> int | None:
    if text is None:
        if split:
            raise typer.BadParameter(_("--split needs a size: --max-size 500MB"), param_hint="--split")
        return None
    match = _SIZE_PATTERN.fullmatch(text.strip())
    size_bytes = round(float(match[1].replace(",", ".")) * _UNIT_BYTES[match[2].lower()]) if match else 0
    if not splits.MIN_PART_BYTES <= size_bytes < 2**63:
        raise typer.BadParameter(
            _("'{given}' isn't a valid size; use 100kB or more, such as 500MB or 2GB").format(
                given=quotable(text)
            ),
            param_hint="--max-size",
        )
    return size_bytes


def _wait(
    ended: threading.Event,
    file: writer.RecordingWriter,
    duration_s: float | None,
    max_bytes: int | None,
) -> None:
    out = console(stderr=True)
    deadline = None if duration_s is None else time.monotonic() + duration_s

    def wait() -> bool:
        if max_bytes is not None and file.status.size_bytes >= max_bytes:
            return True
        remaining_s = (
            _STATUS_PERIOD_S if deadline is None else min(_STATUS_PERIOD_S, deadline - time.monotonic())
        )
        return remaining_s <= 0.0 or ended.wait(remaining_s)

    if not out.is_terminal:
        while not wait():
            pass
        return
    with out.status("") as status_display:
        while not wait():
            status_display.update(_status_line(file.status))


def _status_line(status: writer.RecordingStatus) -> str:
    lost = sum(each.lost or 0 for each in status.topics.values())
    return _("{time}  {messages} messages, {size}, {lost} lost, {unkept} write errors").format(
        time=clock_text(status.duration_s),
        messages=status.message_count,
        size=format_size(status.size_bytes),
        lost=lost,
        unkept=status.unkept,
    )


def _show_summary(path: Path, status: writer.RecordingStatus) -> None:
    topics = ngettext("{count} topic", "{count} topics", len(status.topics))
    template = ngettext(
        "{count} message of {topics} in {time}, {size}: '{path}'",
        "{count} messages of {topics} in {time}, {size}: '{path}'",
        status.message_count,
    )
    print_status(
        template.format(
            count=status.message_count,
            topics=topics.format(count=len(status.topics)),
            time=clock_text(status.duration_s),
            size=format_size(status.size_bytes),
            path=path,
        )
    )
    for topic, topic_status in sorted(status.topics.items()):
        missing = (topic_status.lost or 0) + topic_status.unkept
        if missing:
            template = ngettext(
                "'{topic}': {count} message is missing ({lost} lost, {unkept} write errors)",
                "'{topic}': {count} messages are missing ({lost} lost, {unkept} write errors)",
                missing,
            )
            print_status(
                template.format(
                    count=missing, topic=topic, lost=topic_status.lost or 0, unkept=topic_status.unkept
                )
            )
