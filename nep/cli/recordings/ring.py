"""`nep recording ring` and `keep`: buffer the last seconds of messages and save them on request."""

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
from nep.cli.network import open_command_node
from nep.cli.options import JsonOption, MasterOption
from nep.cli.recordings.recording_files import TopicsToRecordArgument, clock_text
from nep.cli.screen import console, format_size, print_status, show_json
from nep.errors import NepError, RecordingError
from nep.i18n import _, ngettext
from nep.protocol.graph_view import GraphView
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from nep.recordings import recorder
    from nep.recordings import ring as rings
else:  # imported on use: other commands stay fast and need no extra packages
    recorder = lazy_module("nep.recordings.recorder")
    rings = lazy_module("nep.recordings.ring")

_STATUS_PERIOD_S = 0.2
SAVE_TIMEOUT_S = 120.0
"""Time limit of a save in seconds; copying some GB to a slow disk takes long."""
_BUFFER_FOLDER = ".nep-ring"
_STOP, _KEEP = "end", "keep"
_DEFAULT_NAME = "flight_recorder"
KEEP_SERVICE = f"{_DEFAULT_NAME}/keep"
"""Name of the service that saves the buffer of the flight recorder with the default name."""
NameOption = Annotated[
    str,
    typer.Option("--name", metavar=_("NAME"), help=_("Name of the flight recorder, if several are running.")),
]


class _Saver:
    """Writer that saves the buffer of a flight recorder to files, one at a time. Thread-safe."""

    def __init__(self, ring: rings.FlightRecorder, folder: Path, seconds: float, *, as_json: bool) -> None:
        self._ring, self._folder, self._buffer_s, self._as_json = ring, folder, seconds, as_json
        self._lock = threading.Lock()

    def handle_request(self, request: object) -> dict[str, object]:
        # The request is {"seconds": 30, "note": "it fell"}; both keys are optional. Raises `NepError`.
        request_body = request if isinstance(request, dict) else {}
        seconds, note = request_body.get("seconds", self._buffer_s), request_body.get("note", "")
        is_number = isinstance(seconds, int | float) and not isinstance(seconds, bool)
        if not is_number or not isinstance(note, str):
            raise NepError(_('the request must be a JSON object such as {"seconds": 30, "note": "it fell"}'))
        return self.save(float(seconds), note)

    def save(self, seconds: float | None = None, note: str = "") -> dict[str, object]:
        duration_s = self._buffer_s if seconds is None else seconds
        if not 0.0 < duration_s < 1e9:
            raise NepError(
                _("{given:g} isn't a valid duration; use a number of seconds greater than 0").format(
                    given=duration_s
                )
            )
        with self._lock:
            saved = self._ring.save(self._free_path(), min(duration_s, self._buffer_s), note)
        result: dict[str, object] = {**asdict(saved), "path": str(saved.path.resolve())}
        if self._as_json:
            show_json(result)
        else:
            template = ngettext(
                "saved {count} message of the last {time}: '{path}'",
                "saved {count} messages of the last {time}: '{path}'",
                saved.message_count,
            )
            time = clock_text(saved.duration_s)
            print_status(template.format(count=saved.message_count, time=time, path=saved.path))
        return result

    def _free_path(self) -> Path:
        stem = datetime.now().astimezone().strftime("kept-%Y-%m-%d-%H-%M-%S")
        path, number = self._folder / f"{stem}.mcap", 2
        while path.exists():
            path, number = self._folder / f"{stem}-{number}.mcap", number + 1
        return path


def ring(
    topics: TopicsToRecordArgument = None,
    seconds: Annotated[
        float, typer.Option("--seconds", "-s", metavar=_("SECONDS"), help=_("Length of the buffer."))
    ] = 60.0,
    size_gb: Annotated[float, typer.Option("--size", metavar="GB", help=_("Maximum size on disk."))] = 2.0,
    folder: Annotated[
        Path,
        typer.Option(
            "--output", "-o", metavar=_("FOLDER"), help=_("Folder for saved recordings."), file_okay=False
        ),
    ] = Path(),
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
    name: NameOption = _DEFAULT_NAME,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Run a flight recorder: buffer the last seconds of messages until Ctrl+C.

    'nep recording keep', a call to the service flight_recorder/keep (for example by an alarm) or the signal
    SIGUSR1 saves them as a recording, while buffering continues.
    """
    for value, min_value, max_value, hint in (
        (seconds, 0.1, 1e6, "--seconds"),
        (size_gb, 0.001, 1e6, "--size"),
    ):
        if not min_value <= value <= max_value:
            template = _("{given:g} is out of range; use {least:g} to {most:g}")
            raise typer.BadParameter(
                template.format(given=value, least=min_value, most=max_value), param_hint=hint
            )
    selection = recorder.TopicSelection(tuple(topics or ()), tuple(excluded or ()))
    commands: queue.SimpleQueue[str] = queue.SimpleQueue()
    with open_command_node("ring", master) as node:
        node.graph()  # fail before writing anything if there is no master
        buffer_folder = folder / _BUFFER_FOLDER
        with rings.FlightRecorder(
            buffer_folder,
            seconds=seconds,
            size_bytes=round(size_gb * 1e9),
            on_problem=lambda _why: commands.put(_STOP),
        ) as flight_recorder:
            saver = _Saver(flight_recorder, folder, seconds, as_json=as_json)
            with (
                recorder.Recorder(node, flight_recorder, selection),
                node.new_server(f"{name}/keep", saver.handle_request, threads=1),
            ):
                interrupts.call_on_signal(lambda: commands.put(_STOP))
                _save_on_signal(commands)
                if not as_json:
                    template = _(
                        "buffering the last {seconds:g} s; run 'nep recording keep' to save them, "
                        "press Ctrl+C to stop"
                    )
                    print_status(template.format(seconds=seconds))
                _run_commands(commands, saver, flight_recorder)
            problem = flight_recorder.status.problem
        with suppress(OSError):  # another flight recorder uses the same folder
            buffer_folder.rmdir()
    if problem:
        raise RecordingError(str(folder), problem)


def _save_on_signal(commands: queue.SimpleQueue[str]) -> None:
    def handle(_signal: int, _frame: FrameType | None) -> None:
        commands.put(_KEEP)

    if hasattr(signal, "SIGUSR1"):
        with suppress(ValueError):  # signal handlers can be set in the main thread only
            signal.signal(signal.SIGUSR1, handle)


def _run_commands(
    commands: queue.SimpleQueue[str], saver: _Saver, flight_recorder: rings.FlightRecorder
) -> None:
    out = console(stderr=True)

    def next_command() -> str:
        with suppress(queue.Empty):
            return commands.get(timeout=_STATUS_PERIOD_S)
        return ""

    with out.status("") if out.is_terminal else nullcontext() as status_display:
        while (command := next_command()) != _STOP:
            if command == _KEEP:
                try:
                    saver.save()
                except NepError as error:
                    print_status(str(error))
            if status_display is not None:
                status = flight_recorder.status
                template = _("{time} buffered, {size}")
                status_display.update(
                    template.format(time=clock_text(status.seconds), size=format_size(status.size_bytes))
                )


def has_flight_recorder(graph: GraphView, service: str = KEEP_SERVICE) -> bool:
    """Return True if a flight recorder offers `service`.

    Check this before calling the service, because a call without a server waits for the whole time
    limit.
    """
    service_info = graph.services.get(service)
    return service_info is not None and bool(service_info.servers)


def keep(
    note: Annotated[
        str,
        typer.Option(
            "--note", metavar=_("TEXT"), help=_("Note to store in the recording."), show_default=False
        ),
    ] = "",
    seconds: Annotated[
        float | None,
        typer.Option(
            "--seconds",
            "-s",
            metavar=_("SECONDS"),
            help=_("Save only the last seconds of the buffer."),
            show_default=False,
        ),
    ] = None,
    name: NameOption = _DEFAULT_NAME,
    master: MasterOption = None,
    as_json: JsonOption = False,
) -> None:
    """Make 'nep recording ring' save the last seconds as a recording, also on another computer."""
    request_body: dict[str, object] = {"note": note}
    if seconds is not None:
        request_body["seconds"] = seconds
    with open_command_node("keep", master) as node:
        if not has_flight_recorder(node.graph(), f"{name}/keep"):
            raise NepError(_("nothing to save: 'nep recording ring' isn't running"))
        reply = node.new_client(f"{name}/keep", timeout_s=SAVE_TIMEOUT_S).call(request_body)
    result = reply if isinstance(reply, dict) else {}
    if as_json:
        show_json(result)
    else:
        print_status(_("saved to '{path}'").format(path=result.get("path", "")))
