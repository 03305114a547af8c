"""What the commands about recordings share: their arguments, topics of a file, progress, times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli.screen import console
from nep.errors import NepError, did_you_mean
from nep.i18n import _
from nep.protocol.topic_glob import glob_matches, is_glob
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import reader
else:  # the other commands need not wait for it, nor have what it needs
    reader = lazy_module("nep.recordings.reader")

__all__ = [
    "FileArgument",
    "FromOption",
    "RecordedTopicsArgument",
    "ToOption",
    "chosen_topics",
    "clock_text",
    "progress_bar",
    "span_ns",
]

FileArgument = Annotated[
    Path, typer.Argument(metavar=_("FILE"), help=_("The recording."), show_default=False, dir_okay=False)
]
FromOption = Annotated[
    float | None,
    typer.Option(
        "--from", metavar=_("SECONDS"), help=_("So long after its start; 0 is its start."), show_default=False
    ),
]
ToOption = Annotated[
    float | None,
    typer.Option("--to", metavar=_("SECONDS"), help=_("Up to so long after its start."), show_default=False),
]


def _complete_recorded(ctx: typer.Context, incomplete: str) -> list[str]:
    """Topics of the file that the line names already. Nothing here may print or raise."""
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
        autocompletion=_complete_recorded,
    ),
]


def chosen_topics(recording: reader.Recording, words: Sequence[str]) -> list[str]:
    """The topics that words mean, in their order. Raises `typer.BadParameter` for one that there is not."""
    chosen: dict[str, None] = {}
    for word in words:
        found = [name for name in recording.topics if glob_matches(word, name)]
        if not found:
            known = tuple(recording.topics)
            if is_glob(word):
                raise typer.BadParameter(_("no topic of the recording matches '{word}'").format(word=word))
            raise typer.BadParameter(
                _("the recording has no topic '{word}'; {did_you_mean}").format(
                    word=word, did_you_mean=did_you_mean(word, known)
                )
            )
        chosen.update(dict.fromkeys(found))
    return list(chosen)


def span_ns(
    recording: reader.Recording, from_s: float | None, to_s: float | None
) -> tuple[int | None, int | None]:
    """Times in ns since 1970 of seconds after a recording's start. Raises `typer.BadParameter`."""
    for each in (from_s, to_s):
        if each is not None and not 0.0 <= each < 1e9:
            raise typer.BadParameter(_("{given:g} is no time; give seconds, 0 or more").format(given=each))
    if from_s is not None and to_s is not None and from_s >= to_s:
        raise typer.BadParameter(_("the part ends before it begins"))
    start = None if from_s is None else recording.start_ns + int(from_s * 1e9)
    end = None if to_s is None else recording.start_ns + int(to_s * 1e9)
    return start, end


def clock_text(seconds: float) -> str:
    """A time within a recording: "12:41", "1:02:03"."""
    whole = int(seconds)
    hours, rest = divmod(whole, 3600)
    minutes, secs = divmod(rest, 60)
    return f"{hours}:{minutes:02d}:{secs:02d}" if hours else f"{minutes}:{secs:02d}"


@contextmanager
def progress_bar(said: str) -> Iterator[Callable[[int, int], object]]:
    """A bar on the error stream of a terminal; nothing in a file. Gives what is told (done, total)."""
    out = console(stderr=True)
    if not out.is_terminal:
        yield lambda _done, _total: None
        return
    from rich.progress import Progress  # noqa: PLC0415 - see `nep.cli.screen.console`

    with Progress(console=out, transient=True) as progress:
        task = progress.add_task(said, total=None)

        def told(done: int, total: int) -> None:
            progress.update(task, completed=done, total=total)

        yield told
