"""`nep recording ring` and `keep`: the last seconds of what is published, and a file of them when told."""

from __future__ import annotations

import queue
import signal
import threading
from contextlib import nullcontext, suppress
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated

import typer

from nep.cli import interrupts
from nep.cli.complete import complete_topic
from nep.cli.network import node_for
from nep.cli.options import JsonOption, MasterOption
from nep.cli.recording_files import TopicsToRecord, clock_text
from nep.cli.screen import console, say, show_json, size
from nep.errors import NepError, RecordingError
from nep.i18n import _, ngettext
from nep.protocol.graph_view import GraphView
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import recorder
    from nep.recordings import ring as rings
else:  # the other commands need not wait for it, nor have what it needs
    recorder = lazy_module("nep.recordings.recorder")
    rings = lazy_module("nep.recordings.ring")

_LOOK_S = 0.2
KEEP_S = 120.0
"""So long may it take to copy what is there: some GB on a slow disk."""
_FOLDER = ".nep-ring"
_END, _KEEP = "end", "keep"
_NAME = "flight_recorder"
KEEP_SERVICE = f"{_NAME}/keep"
"""Keeps the last seconds, where nobody has given the ring another name."""
NameOption = Annotated[
    str,
    typer.Option("--name", metavar=_("NAME"), help=_("Its name, where several are on.")),
]


class _Keeper:
    """Makes files of a ring, one at a time, in whichever thread asks."""

    def __init__(self, ring: rings.FlightRecorder, folder: Path, seconds: float, *, as_json: bool) -> None:
        self._ring, self._folder, self._seconds, self._as_json = ring, folder, seconds, as_json
        self._lock = threading.Lock()

    def answer(self, request: object) -> dict[str, object]:
        """The service: {"seconds": 30, "note": "it fell"}, both may be missing. Raises `NepError`."""
        asked = request if isinstance(request, dict) else {}
        seconds, note = asked.get("seconds", self._seconds), asked.get("note", "")
        is_number = isinstance(seconds, int | float) and not isinstance(seconds, bool)
        if not is_number or not isinstance(note, str):
            raise NepError(_('what is asked is a map such as {"seconds": 30, "note": "it fell"}'))
        return self.keep(float(seconds), note)

    def keep(self, seconds: float | None = None, note: str = "") -> dict[str, object]:
        """Make a file of the last seconds that are there, and tell of it. Raises `NepError`."""
        wanted = self._seconds if seconds is None else seconds
        if not 0.0 < wanted < 1e9:
            raise NepError(_("{given:g} is no time; give seconds, more than 0").format(given=wanted))
        with self._lock:
            kept = self._ring.keep(self._free_path(), min(wanted, self._seconds), note)
        told: dict[str, object] = {**asdict(kept), "path": str(kept.path.resolve())}
        if self._as_json:
            show_json(told)
        else:
            words = ngettext(
                "kept {count} message of the last {time}: '{path}'",
                "kept {count} messages of the last {time}: '{path}'",
                kept.message_count,
            )
            time = clock_text(kept.duration_s)
            say(words.format(count=kept.message_count, time=time, path=kept.path))
        return told

    def _free_path(self) -> Path:
        stem = datetime.now().astimezone().strftime("kept-%Y-%m-%d-%H-%M-%S")
        made, number = self._folder / f"{stem}.mcap", 2
        while made.exists():
            made, number = self._folder / f"{stem}-{number}.mcap", number + 1
        return made


def ring(
    topics: TopicsToRecord = None,
    seconds: Annotated[
        float, typer.Option("--seconds", "-s", metavar=_("SECONDS"), help=_("How much of the past is there."))
    ] = 60.0,
    size_gb: Annotated[
        float, typer.Option("--size", metavar="GB", help=_("How much of the disk it takes at most."))
    ] = 2.0,
    folder: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar=_("FOLDER"), help=_("Where what is kept goes."), file_okay=False
        ),
    ] = Path(),
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
    name: NameOption = _NAME,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Keep the last seconds of what is published, until Ctrl+C: a flight recorder.

    'nep recording keep', a call of the service flight_recorder/keep, from an alarm say, or the signal USR1
    makes a recording of them; meanwhile it goes on.
    """
    for given, least, most, hint in ((seconds, 0.1, 1e6, "--seconds"), (size_gb, 0.001, 1e6, "--size")):
        if not least <= given <= most:
            said = _("{given:g} can't be; give {least:g} to {most:g}")
            raise typer.BadParameter(said.format(given=given, least=least, most=most), param_hint=hint)
    selection = recorder.TopicSelection(tuple(topics or ()), tuple(left_out or ()))
    orders: queue.SimpleQueue[str] = queue.SimpleQueue()
    with node_for("ring", master) as node:
        node.graph()  # so that a master that is not there is said before anything is written
        place = folder / _FOLDER
        with rings.FlightRecorder(
            place, seconds=seconds, size_bytes=round(size_gb * 1e9), on_problem=lambda _why: orders.put(_END)
        ) as kept:
            keeper = _Keeper(kept, folder, seconds, as_json=as_json)
            with (
                recorder.Recorder(node, kept, selection),
                node.new_server(f"{name}/keep", keeper.answer, threads=1),
            ):
                interrupts.call_first(lambda: orders.put(_END))
                _keep_on_signal(orders)
                if not as_json:
                    said = _(
                        "keeping the last {seconds:g} s; 'nep recording keep' makes a file, Ctrl+C ends it"
                    )
                    say(said.format(seconds=seconds))
                _carry_out(orders, keeper, kept)
            problem = kept.status.problem
        with suppress(OSError):  # another one is on in the same folder
            place.rmdir()
    if problem:
        raise RecordingError(str(folder), problem)


def _keep_on_signal(orders: queue.SimpleQueue[str]) -> None:
    """Where there are such signals."""

    def handle(_signal: int, _frame: FrameType | None) -> None:
        orders.put(_KEEP)

    if hasattr(signal, "SIGUSR1"):
        with suppress(ValueError):  # only the main thread may
            signal.signal(signal.SIGUSR1, handle)


def _carry_out(orders: queue.SimpleQueue[str], keeper: _Keeper, kept: rings.FlightRecorder) -> None:
    """Until it is to end; what is there to be kept stands on a terminal's last line."""
    out = console(stderr=True)

    def next_order() -> str:
        with suppress(queue.Empty):
            return orders.get(timeout=_LOOK_S)
        return ""

    with out.status("") if out.is_terminal else nullcontext() as shown:
        while (order := next_order()) != _END:
            if order == _KEEP:
                try:
                    keeper.keep()
                except NepError as error:
                    say(str(error))
            if shown is not None:
                status = kept.status
                words = _("{time} there, {size}")
                shown.update(words.format(time=clock_text(status.seconds), size=size(status.size_bytes)))


def has_ring(graph: GraphView, service: str = KEEP_SERVICE) -> bool:
    """Whether anybody can keep the last seconds: who asks nobody would wait for long."""
    known = graph.services.get(service)
    return known is not None and bool(known.servers)


def keep(
    note: Annotated[
        str, typer.Option("--note", metavar=_("TEXT"), help=_("Words about it."), show_default=False)
    ] = "",
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds", "-s", metavar=_("SECONDS"), help=_("Only the last of them."), show_default=False
        ),
    ] = None,
    name: NameOption = _NAME,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Tell 'nep recording ring' to make a recording of the last seconds; it may be on another computer."""
    asked: dict[str, object] = {"note": note}
    if seconds is not None:
        asked["seconds"] = seconds
    with node_for("keep", master) as node:
        if not has_ring(node.graph(), f"{name}/keep"):
            raise NepError(_("no 'nep recording ring' is on, so there is nothing to keep"))
        answer = node.new_client(f"{name}/keep", timeout_s=KEEP_S).call(asked)
    told = answer if isinstance(answer, dict) else {}
    if as_json:
        show_json(told)
    else:
        say(_("kept in '{path}'").format(path=told.get("path", "")))
