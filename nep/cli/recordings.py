"""`nep recording`: what is in a recording, mend it, make other files of it."""

from __future__ import annotations

from datetime import datetime, timezone
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import ring
from nep.cli.options import JsonOption
from nep.cli.recording_files import (
    FileArgument,
    FromOption,
    RecordedTopicsArgument,
    ToOption,
    chosen_topics,
    clock_text,
    progress_bar,
    span_ns,
)
from nep.cli.screen import UNKNOWN, TextColumn, rate, say, show_json, show_table, size, write
from nep.cli.typer_words import TranslatedGroup
from nep.i18n import _, lazy, ngettext, number
from nep.system.lazy_import import lazy_module
from nep.text import escaped

if TYPE_CHECKING:
    from nep.recordings import export as exports
    from nep.recordings import figures, reader
    from nep.recordings import repair as repairs
else:  # the other commands need not wait for it, nor have what it needs
    exports = lazy_module("nep.recordings.export")
    figures = lazy_module("nep.recordings.figures")
    reader = lazy_module("nep.recordings.reader")
    repairs = lazy_module("nep.recordings.repair")

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("What was recorded: look into it, mend it, make other files of it."),
)
app.command("ring")(ring.ring)
app.command("keep")(ring.keep)
_COLUMNS = (
    TextColumn(lazy("topic"), style="bold", is_whole=True),
    TextColumn(lazy("type")),
    TextColumn(lazy("messages"), "right"),
    TextColumn(lazy("rate"), "right"),
    TextColumn(lazy("lost"), "right"),
    TextColumn(lazy("late"), "right"),
    TextColumn(lazy("unreadable"), "right"),
    TextColumn(lazy("lost in writing"), "right"),
)


@app.command("info")
def info(file: FileArgument, as_json: JsonOption = False) -> None:
    """Tell what is in a recording, and what is missing in it."""
    with reader.Recording(file) as recording:
        told = recording.figures()
        if as_json:
            show_json(_plain(recording, told))
            return
        head = _("{messages} messages in {time}, {size}, from {started}").format(
            messages=recording.message_count,
            time=clock_text(recording.duration_s),
            size=size(recording.size_bytes),
            started=_day_text(recording.start_ns),
        )
        write(f"{head}\n")
        words = recording.words
        if words.get("note"):
            write(f"{escaped(words['note'])}\n")
        show_table(
            _COLUMNS, [_row(recording, each, told.get(each.name)) for each in recording.topics.values()]
        )
        if not recording.is_complete:
            said = _(
                "it was not ended, and is read as far as it is whole; mend it: nep recording repair {file}"
            )
            say(said.format(file=file))


def _day_text(at_ns: int) -> str:
    """A time as the computer's clock shows it; of recordings without messages there is none."""
    try:
        day = datetime.fromtimestamp(at_ns / 1e9, tz=timezone.utc).astimezone() if at_ns else None
    except (OSError, OverflowError, ValueError):  # what another program wrote, and no calendar has
        day = None
    return UNKNOWN if day is None else day.strftime("%Y-%m-%d %H:%M:%S")


def _row(
    recording: reader.Recording, topic: reader.RecordedTopic, told: figures.TopicFigures | None
) -> tuple[str, ...]:
    duration = recording.duration_s
    return (
        escaped(topic.name),
        escaped(topic.msg_type),
        str(topic.message_count),
        rate(topic.message_count / duration) if duration > 0 else UNKNOWN,
        UNKNOWN if told is None or told.lost is None else str(told.lost),
        UNKNOWN if told is None else str(told.late),
        UNKNOWN if told is None else str(told.undecodable),
        UNKNOWN if told is None else str(told.unkept),
    )


def _plain(recording: reader.Recording, told: dict[str, figures.TopicFigures]) -> dict[str, object]:
    return {
        "path": str(recording.path),
        "start_ns": recording.start_ns,
        "end_ns": recording.end_ns,
        "size_bytes": recording.size_bytes,
        "is_complete": recording.is_complete,
        "words": dict(recording.words),
        "topics": {
            each.name: {
                "msg_type": each.msg_type,
                "codec": each.codec,
                "message_count": each.message_count,
                "figures": told[each.name].to_plain() if each.name in told else None,
            }
            for each in recording.topics.values()
        },
    }


@app.command("repair")
def repair(
    file: FileArgument,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE.mcap",
            help=_("The new file; else one beside it."),
            show_default=False,
            dir_okay=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Write what is whole of a cut or damaged recording into a new file, and read that back.

    The damaged file stays as it is.
    """
    with progress_bar(_("mending")) as progress:
        report = repairs.repair(file, output, progress)
    if as_json:
        show_json(
            {
                "path": str(report.path),
                "recovered": report.recovered,
                "discarded": report.discarded,
                "discarded_bytes": report.discarded_bytes,
                "lost_s": report.lost_s,
                "duration_s": report.duration_s,
                "damaged_places": report.damaged_places,
            }
        )
        return
    said = ngettext(
        "{count} message recovered, {time}, and read back: '{path}'",
        "{count} messages recovered, {time}, and read back: '{path}'",
        report.recovered,
    )
    say(said.format(count=report.recovered, time=clock_text(report.duration_s), path=report.path))
    if not report.is_whole:
        gone = UNKNOWN if report.discarded is None else str(report.discarded)
        words = _("lost: {messages} messages, {size}, the last {seconds} s")
        say(
            words.format(
                messages=gone, size=size(report.discarded_bytes), seconds=number(report.lost_s, ".1f")
            )
        )


def _complete_format(incomplete: str) -> list[str]:
    return [each for each in exports.FORMATS if each.startswith(incomplete)]


@app.command("export")
def export(
    file: FileArgument,
    topics: RecordedTopicsArgument = None,
    kind: Annotated[
        str,
        typer.Option(
            "--format",
            "-f",
            metavar="csv|parquet|pictures|mp4|mcap",
            help=_("Tables of values, pictures as files or as a film, or a smaller recording."),
            autocompletion=_complete_format,
        ),
    ] = "csv",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar=_("FOLDER"), help=_("Where to; else beside it."), show_default=False
        ),
    ] = None,
    from_s: FromOption = None,
    to_s: ToOption = None,
    fps: Annotated[float, typer.Option("--fps", metavar="HZ", help=_("Pictures a second of a film."))] = 30.0,
    as_json: JsonOption = False,
) -> None:
    """Make tables (CSV, Parquet) of a recording's values, films of its pictures, or a part of it."""
    if kind not in exports.FORMATS:
        raise typer.BadParameter(_("no format '{kind}'").format(kind=kind), param_hint="--format")
    if not 0.1 <= fps <= 240:
        raise typer.BadParameter(_("a film has 0.1 to 240 pictures a second"), param_hint="--fps")
    with reader.Recording(file) as recording:
        chosen = chosen_topics(recording, topics) if topics else None
        part = exports.Part(*span_ns(recording, from_s, to_s), chosen)
        folder = output or file.with_name(file.stem)
        with progress_bar(_("exporting")) as progress:
            made = exports.export(recording, kind, folder, part, fps=fps, progress=progress)
    if as_json:
        show_json(
            [
                {
                    "topic": each.topic,
                    "path": str(each.path),
                    "count": each.count,
                    "unreadable": each.unreadable,
                }
                for each in made
            ]
        )
        return
    for each in made:
        said = ngettext("{count} message: '{path}'", "{count} messages: '{path}'", each.count)
        say(said.format(count=each.count, path=each.path))
        if each.unreadable:
            words = ngettext(
                "{count} message could not be read and left out",
                "{count} messages could not be read and left out",
                each.unreadable,
            )
            say(words.format(count=each.unreadable))
