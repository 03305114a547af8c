"""`nep recording`: what is in a recording, mend it, make other files of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import recording_info, ring
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
from nep.cli.screen import UNKNOWN, say, show_json, size
from nep.cli.typer_words import TranslatedGroup
from nep.i18n import _, ngettext, number
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import export as exports
    from nep.recordings import reader
    from nep.recordings import repair as repairs
    from nep.recordings.formats import damage
else:  # the other commands need not wait for it, nor have what it needs
    exports = lazy_module("nep.recordings.export")
    damage = lazy_module("nep.recordings.formats.damage")
    reader = lazy_module("nep.recordings.reader")
    repairs = lazy_module("nep.recordings.repair")

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("What was recorded: look into it, mend it, make other files of it."),
)
app.command("info")(recording_info.info)
app.command("ring")(ring.ring)
app.command("keep")(ring.keep)


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
        words = damage.damage_words(recording.damage, recording.start_ns)
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
    else:
        _say_exported(made)
    if words:
        say(words)
        raise typer.Exit(1)


def _say_exported(made: Sequence[exports.Exported]) -> None:
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
