"""`nep record`: what is published, into a file."""

from __future__ import annotations

import threading
import time
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.complete import complete_topic
from nep.cli.network import node_for
from nep.cli.options import JsonOption, MasterOption
from nep.cli.recording_files import TopicsToRecord, clock_text
from nep.cli.screen import console, say, show_json, size
from nep.errors import RecordingError
from nep.i18n import _, ngettext
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import recorder, writer
else:  # the other commands need not wait for it, nor have what it needs
    recorder = lazy_module("nep.recordings.recorder")
    writer = lazy_module("nep.recordings.writer")

_LOOK_S = 0.2


def record(
    topics: TopicsToRecord = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE.mcap",
            help=_("The file; else one that is named after the time."),
            show_default=False,
            dir_okay=False,
        ),
    ] = None,
    left_out: Annotated[
        list[str] | None,
        typer.Option(
            "--not",
            metavar=_("TOPIC|PATTERN"),
            help=_("What to leave out; it wins."),
            show_default=False,
            autocompletion=complete_topic,
        ),
    ] = None,
    note: Annotated[
        str, typer.Option("--note", metavar=_("TEXT"), help=_("Words about it."), show_default=False)
    ] = "",
    duration_s: Annotated[
        float | None,
        typer.Option("--duration", metavar=_("SECONDS"), help=_("End after so long."), show_default=False),
    ] = None,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Record what is published into an MCAP file, as it comes. Ctrl+C ends it cleanly.

    Topics that appear later are recorded too. A pattern means all topics that match it: * is any letters
    between slashes, ? is one letter, ** is any parts or none. Put it into quotes, for the shell has patterns
    too. The file is MCAP, the format of Foxglove and Lichtblick; how many messages were lost stands in it.
    """
    if duration_s is not None and not 0.0 < duration_s < 1e9:
        raise typer.BadParameter(
            _("{given:g} is no time; give seconds, 0 or more").format(given=duration_s),
            param_hint="--duration",
        )
    path = output or Path(datetime.now().astimezone().strftime("recording-%Y-%m-%d-%H-%M-%S.mcap"))
    selection = recorder.TopicSelection(tuple(topics or ()), tuple(left_out or ()))
    ended = threading.Event()
    with node_for("record", master) as node:
        node.graph()  # so that a master that is not there is said before a file is made
        file = writer.RecordingWriter(path, note=note, on_problem=lambda _reason: ended.set())
        try:
            with recorder.Recorder(node, file, selection):
                interrupts.call_first(ended.set)
                if not as_json:
                    said = _("recording into '{path}'; Ctrl+C ends it")
                    say(said.format(path=path))
                _wait(ended, file, duration_s)
        finally:
            status = file.close()
    if as_json:
        plain = {topic: each.to_plain() for topic, each in status.topics.items()}
        show_json(
            {
                "path": str(path),
                "message_count": status.message_count,
                "size_bytes": status.size_bytes,
                "duration_s": status.duration_s,
                "topics": plain,
                "problem": status.problem,
            }
        )
    else:
        _say_end(path, status)
    if status.problem:
        raise RecordingError(str(path), status.problem)


def _wait(ended: threading.Event, file: writer.RecordingWriter, duration_s: float | None) -> None:
    """Until it is to end; how far it is stands on a terminal's last line."""
    out = console(stderr=True)
    until = None if duration_s is None else time.monotonic() + duration_s

    def has_ended() -> bool:
        left = _LOOK_S if until is None else min(_LOOK_S, until - time.monotonic())
        return left <= 0.0 or ended.wait(left)

    if not out.is_terminal:
        while not has_ended():
            pass
        return
    with out.status("") as shown:
        while not has_ended():
            shown.update(_line(file.status))


def _line(status: writer.RecordingStatus) -> str:
    lost = sum(each.lost or 0 for each in status.topics.values())
    return _("{time}  {messages} messages, {size}, lost on the way {lost}, lost in writing {unkept}").format(
        time=clock_text(status.duration_s),
        messages=status.message_count,
        size=size(status.size_bytes),
        lost=lost,
        unkept=status.unkept,
    )


def _say_end(path: Path, status: writer.RecordingStatus) -> None:
    topics = ngettext("{count} topic", "{count} topics", len(status.topics))
    said = ngettext(
        "{count} message of {topics} in {time}, {size}: '{path}'",
        "{count} messages of {topics} in {time}, {size}: '{path}'",
        status.message_count,
    )
    say(
        said.format(
            count=status.message_count,
            topics=topics.format(count=len(status.topics)),
            time=clock_text(status.duration_s),
            size=size(status.size_bytes),
            path=path,
        )
    )
    for topic, each in sorted(status.topics.items()):
        missing = (each.lost or 0) + each.unkept
        if missing:
            said = ngettext(
                "{count} message of '{topic}' is missing: {lost} lost on the way, {unkept} in writing",
                "{count} messages of '{topic}' are missing: {lost} lost on the way, {unkept} in writing",
                missing,
            )
            say(said.format(count=missing, topic=topic, lost=each.lost or 0, unkept=each.unkept))
