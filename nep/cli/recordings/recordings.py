"""`nep recording`: inspect, repair and export recordings."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.options import JsonOption
from nep.cli.recordings import recording_info, ring
from nep.cli.recordings.recording_files import (
    FileArgument,
    FromOption,
    RecordedTopicsArgument,
    ToOption,
    clock_text,
    parse_span_ns,
    progress_bar,
    selected_topics,
)
from nep.cli.screen import UNKNOWN, format_size, print_status, show_json
from nep.cli.typer_texts import TranslatedGroup
from nep.i18n import _, ngettext, number
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import export as exports
    from nep.recordings import reader
    from nep.recordings import repair as repairs
    from nep.recordings.formats import damage
else:  # imported on use: other commands stay fast and need no extra packages
    exports = lazy_module("nep.recordings.export")
    damage = lazy_module("nep.recordings.formats.damage")
    reader = lazy_module("nep.recordings.reader")
    repairs = lazy_module("nep.recordings.repair")

app: typer.Typer = typer.Typer(
    cls=TranslatedGroup,
    no_args_is_help=True,
    help=_("Inspect, repair and export recordings; keep the last seconds."),
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
            help=_("File to write (default: next to the recording)."),
            show_default=False,
            dir_okay=False,
        ),
    ] = None,
    as_json: JsonOption = False,
) -> None:
    """Copy the readable messages of a truncated or damaged recording to a new file and verify it.

    The damaged file isn't changed.
    """
    with progress_bar(_("repairing")) as progress:
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
                "damaged_places": report.corrupt_range_count,
            }
        )
        return
    template = ngettext(
        "recovered and verified {count} message, {time}: '{path}'",
        "recovered and verified {count} messages, {time}: '{path}'",
        report.recovered,
    )
    print_status(
        template.format(count=report.recovered, time=clock_text(report.duration_s), path=report.path)
    )
    if not report.is_complete:
        lost_count = UNKNOWN if report.discarded is None else str(report.discarded)
        loss_template = _("lost: {messages} messages ({size}), including the last {seconds} s")
        print_status(
            loss_template.format(
                messages=lost_count,
                size=format_size(report.discarded_bytes),
                seconds=number(report.lost_s, ".1f"),
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
            help=_("Output format: tables of values, image files, a video, or a smaller recording."),
            autocompletion=_complete_format,
        ),
    ] = "csv",
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar=_("FOLDER"),
            help=_("Folder to write to (default: next to the recording)."),
            show_default=False,
        ),
    ] = None,
    from_s: FromOption = None,
    to_s: ToOption = None,
    fps: Annotated[
        float, typer.Option("--fps", metavar="HZ", help=_("Frames per second of a video."))
    ] = 30.0,
    as_json: JsonOption = False,
) -> None:
    """Export a recording as tables (CSV, Parquet), images, videos, or a smaller recording."""
    if kind not in exports.FORMATS:
        raise typer.BadParameter(_("unknown format '{kind}'").format(kind=kind), param_hint="--format")
    if not 0.1 <= fps <= 240:
        raise typer.BadParameter(_("the frame rate of a video must be 0.1 to 240"), param_hint="--fps")
    with reader.Recording(file) as recording:
        selected = selected_topics(recording, topics) if topics else None
        part = exports.Part(*parse_span_ns(recording, from_s, to_s), selected)
        folder = output or file.with_name(file.stem)
        with progress_bar(_("exporting")) as progress:
            exported = exports.export(recording, kind, folder, part, fps=fps, progress=progress)
        damage_text = damage.corruption_text(recording.corruption, recording.start_ns)
    if as_json:
        show_json(
            [
                {
                    "topic": each.topic,
                    "path": str(each.path),
                    "count": each.count,
                    "unreadable": each.undecodable_count,
                }
                for each in exported
            ]
        )
    else:
        _show_exported(exported)
    if damage_text:
        print_status(damage_text)
        raise typer.Exit(1)


def _show_exported(exported: Sequence[exports.ExportedFile]) -> None:
    for exported_file in exported:
        template = ngettext("{count} message: '{path}'", "{count} messages: '{path}'", exported_file.count)
        print_status(template.format(count=exported_file.count, path=exported_file.path))
        if exported_file.undecodable_count:
            skipped_template = ngettext(
                "skipped {count} undecodable message",
                "skipped {count} undecodable messages",
                exported_file.undecodable_count,
            )
            print_status(skipped_template.format(count=exported_file.undecodable_count))
