"""Common parts of the recording commands: arguments, topic selection, progress bar, times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from datetime import datetime, time, timedelta
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.complete import complete_topic
from nep.cli.screen import console, print_status
from nep.errors import NepError, did_you_mean, nearest
from nep.i18n import _
from nep.protocol.topic_glob import glob_matches, is_glob
from nep.system.lazy_import import lazy_module
from nep.text import quotable

if TYPE_CHECKING:
    from nep.recordings import reader
    from nep.recordings.formats import damage
else:  # imported on use: other commands stay fast and need no extra packages
    damage = lazy_module("nep.recordings.formats.damage")
    reader = lazy_module("nep.recordings.reader")


_MAX_COMPARED_TOPICS, _MAX_LISTED_TOPICS = 1_000, 20
FileArgument = Annotated[
    Path, typer.Argument(metavar=_("FILE"), help=_("Recording file."), show_default=False, dir_okay=False)
]
FromOption = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar=_("SECONDS|TIME"),
        help=_("Start this long after the beginning of the recording, or at this time: 15:04:05."),
        show_default=False,
    ),
]
ToOption = Annotated[
    str | None,
    typer.Option(
        "--to",
        metavar=_("SECONDS|TIME"),
        help=_(
            "Stop this long after the beginning of the recording, or at this time: 15:04:05.5, "
            "2026-11-17T14:04:05Z."
        ),
        show_default=False,
    ),
]
TopicsToRecordArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar=_("TOPIC|PATTERN"),
        help=_("Topics to record, or patterns such as '/arm/*' (default: all)."),
        show_default=False,
        autocompletion=complete_topic,
    ),
]


def _complete_recorded_topic(ctx: typer.Context, incomplete: str) -> list[str]:
    path = ctx.params.get("file")
    if path is None:
        return []
    try:
        with reader.Recording(path) as recording:
            return [name for name in recording.topics if name.startswith(incomplete)]
    except (NepError, OSError):
        return []


RecordedTopicsArgument = Annotated[
    list[str] | None,
    typer.Argument(
        metavar=_("TOPIC|PATTERN"),
        help=_("Topics of the recording, or patterns such as '/arm/*'."),
        show_default=False,
        autocompletion=_complete_recorded_topic,
    ),
]


def selected_topics(recording: reader.Recording, patterns: Sequence[str]) -> list[str]:
    """Return the topics of a recording that match names and patterns.

    Args:
        recording: Recording with the topics.
        patterns: Topic names and patterns; they determine the order of the result.

    Raises:
        typer.BadParameter: A word matches no topic.
    """
    selected: dict[str, None] = {}
    for pattern in patterns:
        matches = [name for name in recording.topics if glob_matches(pattern, name)]
        if not matches:
            topic_names = [quotable(name) for name in islice(recording.topics, _MAX_COMPARED_TOPICS)]
            if is_glob(pattern):
                raise typer.BadParameter(_("no topic of the recording matches '{word}'").format(word=pattern))
            if nearest(pattern, topic_names) is None:
                del topic_names[_MAX_LISTED_TOPICS:]
            raise typer.BadParameter(
                _("the recording has no topic '{word}'; {did_you_mean}").format(
                    word=pattern, did_you_mean=did_you_mean(pattern, topic_names)
                )
            )
        selected.update(dict.fromkeys(matches))
    return list(selected)


def exit_if_damaged(recording: reader.Recording) -> None:
    """Print the damage of a recording and exit with code 1; return normally if the recording is intact."""
    damage_text = damage.corruption_text(recording.corruption, recording.start_ns)
    if damage_text:
        print_status(damage_text)
        raise typer.Exit(1)


def parse_span_ns(
    recording: reader.Recording, begin: str | float | None, end: str | float | None
) -> tuple[int | None, int | None]:
    """Parse the beginning and end of a part of a recording; return them in ns since 1970.

    Args:
        recording: The recording.
        begin: Beginning of the part in the format of `parse_time_ns`; None for that of the recording.
        end: End of the part in the format of `parse_time_ns`; None for the end of the recording.

    Raises:
        typer.BadParameter: A time is invalid, or the part is empty.
    """
    first = None if begin is None else parse_time_ns(str(begin), recording.start_ns, recording.end_ns)
    last = None if end is None else parse_time_ns(str(end), recording.start_ns, recording.end_ns)
    if first is not None and last is not None and first >= last:
        raise typer.BadParameter(_("--to must be later than --from"))
    return first, last


def parse_time_ns(text: str, start_ns: int, end_ns: int) -> int:
    """Parse a time within a recording and return it in ns since 1970.

    Accepts seconds after the start ("12.5"), a time of day ("15:04:05", "15:04:05.250", "15:04:05Z") or a
    date and time ("2026-11-17T15:04:05"). Times are local unless they end with "Z" or an offset such as
    "+02:00". A time of day before the start means the next day if the recording lasts until then.

    Raises:
        typer.BadParameter: The time is invalid.
    """
    stripped = text.strip()
    try:
        seconds = float(stripped)
    except ValueError:
        return _parse_clock_time_ns(stripped, start_ns, end_ns)
    if not 0.0 <= seconds < 1e9:
        raise typer.BadParameter(
            _("{given:g} isn't a valid duration; use a number of seconds, 0 or greater").format(given=seconds)
        )
    return start_ns + int(seconds * 1e9)


def _parse_clock_time_ns(text: str, start_ns: int, end_ns: int) -> int:
    iso = f"{text[:-1]}+00:00" if text.endswith(("Z", "z")) else text
    try:
        try:
            clock_time = time.fromisoformat(iso)
        except ValueError:
            return _to_unix_ns(datetime.fromisoformat(iso))
        start = datetime.fromtimestamp(start_ns / 1e9, clock_time.tzinfo)  # local time without a time zone
        time_ns = _to_unix_ns(datetime.combine(start.date(), clock_time))
        later = _to_unix_ns(datetime.combine(start.date() + timedelta(days=1), clock_time))
    except (ValueError, OverflowError, OSError) as error:
        raise typer.BadParameter(
            _("'{given}' isn't a valid time; use seconds after the start, or a time such as 15:04:05").format(
                given=quotable(text)
            )
        ) from error
    return later if time_ns < start_ns and later <= end_ns else time_ns


def _to_unix_ns(moment: datetime) -> int:
    # In ns; local time without a time zone. Raises as `datetime.timestamp` does.
    return int(moment.replace(microsecond=0).timestamp()) * 1_000_000_000 + moment.microsecond * 1000


def clock_text(seconds: float) -> str:
    """Format a duration as "12:41" or "1:02:03"."""
    total_s = int(seconds)
    hours, remaining_s = divmod(total_s, 3600)
    minutes, secs = divmod(remaining_s, 60)
    return f"{hours}:{minutes:02d}:{secs:02d}" if hours else f"{minutes}:{secs:02d}"


@contextmanager
def progress_bar(description: str) -> Iterator[Callable[[int, int], object]]:
    """Show a progress bar on stderr if stderr is a terminal; yield a callback (done, total).

    Args:
        description: Description of the operation, shown before the bar.
    """
    out = console(stderr=True)
    if not out.is_terminal:
        yield lambda _done, _total: None
        return
    from rich.progress import Progress  # noqa: PLC0415 - see `nep.cli.screen.console`

    with Progress(console=out, transient=True) as progress:
        task = progress.add_task(description, total=None)

        def on_progress(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        yield on_progress
