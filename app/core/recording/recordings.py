"""Recordings of a session: recordings by the user, the flight recorder, and the folder of files."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from contextlib import suppress
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from app.core.alerts.alerts import Alerts
from app.core.recording.client import (
    RecorderClient,
    RecorderEvent,
    RecorderExited,
    RecorderProcess,
    RingChoice,
    StartRecorder,
)
from app.core.recording.events import RecordedEvents
from app.core.recording.topic_choice import (
    RecordingChoice,
    RingSettings,
    choice_to_json,
    file_stem,
    free_path,
    parse_choice,
    parse_ring_settings,
    ring_settings_to_json,
)
from app.core.storage.folders import data_home
from app.core.storage.setting import Setting
from app.core.storage.settings import Settings
from app.core.world.part import SessionPart
from app.errors import SettingsError
from app.intents import ChooseRecordingsFolder
from nep.i18n import _, lazy
from nep.programs.alarms import AlarmAction, AlarmEvent
from nep.programs.alarms.alarms import DoneCallback
from nep.programs.alarms.sentences import event_text
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.core.recording import folder as folders
    from app.core.recording import opener as openers
else:  # they import the reading of recordings, which no start should wait for
    folders = lazy_module("app.core.recording.folder")
    openers = lazy_module("app.core.recording.opener")

T = TypeVar("T")

NO_FOLDER_ALERT = "recorder:folder"
_GB = 1_000_000_000
_SAVED_FILE_PATTERN = re.compile(r"[\w.-]+\.mcap\b")


def _ignore_created(_path: Path, _kind: str) -> None: ...


class SessionRecordings(SessionPart):
    """Recordings of a session. Not thread-safe; use it from the main thread, including `on_event`.

    Attributes:
        on_created: Callback for each finished file, with its path and "recorded" or "kept" (flight
            recorder).
    """

    task = lazy("monitor the recorder")

    def __init__(
        self,
        settings: Settings,
        alerts: Alerts,
        address: str,
        post_event: Callable[[object], object],
        *,
        start: StartRecorder = RecorderProcess,
        clock: Callable[[], float] = time.monotonic,
        now: Callable[[], datetime] = datetime.now,
        uses_reader_process: bool = True,
    ) -> None:
        # `uses_reader_process`: recordings are read in separate processes.
        self._uses_reader_process = uses_reader_process
        self._settings, self._alerts, self._clock, self._now = settings, alerts, clock, now
        self.client = RecorderClient(address, alerts, post_event, start=start, clock=clock)
        self.events = RecordedEvents(self.client.add_event)
        self.choice = parse_choice(settings.recording)
        self.ring_settings = parse_ring_settings(settings.flight_recorder)
        self.on_created: Callable[[Path, str], object] = _ignore_created
        self.active_choice = self.choice
        """Selection of the recording in progress."""
        self._started_s: float | None = None
        self._pending_saves: dict[Path, DoneCallback | None] = {}

    # ---- folder

    @property
    def folder(self) -> Path:
        """Folder of recordings."""
        return self._settings.recordings_folder

    def set_folder(self, folder: Path) -> None:
        """Set and save the folder of recordings."""
        self._save_setting(Settings.recordings_folder, folder)
        self._alerts.resolve(NO_FOLDER_ALERT)

    def _prepare_folder(self) -> Path | None:
        # None if it doesn't exist, which an alert reports. A chosen folder is not created: its disk may not
        # be mounted.
        folder = self.folder
        problem = ""
        try:
            if not self._settings.is_stored(Settings.recordings_folder):
                folder.mkdir(parents=True, exist_ok=True)
            if not folder.is_dir():
                problem = _("{folder} doesn't exist.").format(folder=folder)
        except OSError as error:
            reason = (error.strerror or str(error)).lower()
            problem = _("Can't create {folder}: {reason}.").format(folder=folder, reason=reason)
        if not problem:
            self._alerts.resolve(NO_FOLDER_ALERT)
            return folder
        self._alerts.raise_alert(
            NO_FOLDER_ALERT,
            "error",
            _("Not recording: the recordings folder is missing."),
            problem,
            button=_("Choose a folder"),
            intent=ChooseRecordingsFolder(),
        )
        return None

    def new_opener(self) -> openers.RecordingOpener:
        """Return a new opener of recordings. The caller must close it."""
        return openers.process_opener() if self._uses_reader_process else openers.LocalOpener()

    # ---- recording

    @property
    def is_recording(self) -> bool:
        """True if a recording is starting, in progress, or being finished."""
        return bool(self.client.state.phase)

    @property
    def elapsed_s(self) -> float:
        """Duration of the recording in seconds; 0 while idle or starting."""
        return 0.0 if self._started_s is None else max(0.0, self._clock() - self._started_s)

    def set_choice(self, choice: RecordingChoice) -> None:
        """Set and save the topic selection for the next recordings."""
        self.choice = choice
        self._save_setting(Settings.recording, choice_to_json(choice))

    def record(self, name: str = "", note: str = "", choice: RecordingChoice | None = None) -> str:
        """Start a recording; return the reason if it can't start, else "".

        Args:
            name: Name of the file; by default, the file is named by the time.
            note: Note stored in the file.
            choice: Topic selection for this recording only; default: the saved selection.
        """
        choice = choice if choice is not None else self.choice
        if self.is_recording:
            return _("Already recording.")
        if choice.problem:
            return choice.problem
        folder = self._prepare_folder()
        if folder is None:
            return _("The recordings folder is missing.")
        stem = file_stem(name)
        path = (
            free_path(folder / f"{stem}{folders.SUFFIX}") if stem else folders.new_path(folder, self._now())
        )
        selection = choice.selection
        self.client.record(
            path,
            selection.topics,
            selection.excluded,
            note,
            seconds=None if choice.max_minutes is None else 60.0 * choice.max_minutes,
            max_bytes=None if choice.max_gb is None else round(choice.max_gb * _GB),
        )
        self.active_choice, self._started_s = choice, None
        return ""

    def stop(self) -> None:
        """Stop the recording."""
        self.client.stop()

    # ---- flight recorder

    @property
    def is_ring_on(self) -> bool:
        """True if the flight recorder is on."""
        return self.client.state.ring_s is not None

    def set_ring_settings(self, ring_settings: RingSettings) -> None:
        """Set and save the settings of the flight recorder.

        A change of the topics, the duration or the size restarts the flight recorder and discards its
        content.
        """
        self.ring_settings = ring_settings
        self._save_setting(Settings.flight_recorder, ring_settings_to_json(ring_settings))
        self._apply_ring_settings()

    def _apply_ring_settings(self) -> None:
        ring_settings = self.ring_settings
        if not ring_settings.is_on:
            self.client.set_ring(None)
            return
        folder = data_home() / "flight-recorder"
        size_bytes = round(ring_settings.size_gb * _GB)
        self.client.set_ring(
            RingChoice(
                folder,
                float(ring_settings.seconds),
                size_bytes,
                ring_settings.patterns,
                ring_settings.excluded,
            )
        )

    def save_last(
        self, note: str = "", seconds: float | None = None, on_done: DoneCallback | None = None
    ) -> str:
        """Save the newest content of the flight recorder; return the reason if that can't start, else "".

        Args:
            note: Note stored in the file.
            seconds: Duration to save; default: the whole content.
            on_done: Called with the result when the file is finished.
        """
        if not self.ring_settings.is_on:
            return _("The flight recorder is off.")
        folder = self._prepare_folder()
        if folder is None:
            return _("The recordings folder is missing.")
        prefix = "alarm" if on_done is not None else "kept"
        path = folders.new_path(folder, self._now(), prefix)
        number = 2
        while path in self._pending_saves:
            path, number = path.with_stem(f"{path.stem}-{number}"), number + 1
        if not self.client.save_last(
            path, seconds if seconds is not None else float(self.ring_settings.seconds), note
        ):
            return _("The last seconds can't be saved now.")
        self._pending_saves[path] = on_done
        return ""

    def save_for_alarm(self, event: AlarmEvent, action: AlarmAction, on_done: DoneCallback) -> None:
        """Save the newest content of the flight recorder, as the action of an alarm.

        Args:
            event: Alarm event that triggered the action.
            action: Action with the duration to save.
            on_done: Called with the result.
        """
        text = event_text(event.rule.condition, event.value)
        problem = self.save_last(text, action.recording_s, on_done)
        if problem:
            template = _("nothing saved: {reason}")
            on_done(False, template.format(reason=f"{problem[:1].lower()}{problem[1:]}".rstrip(".")))

    # ---- interface of the session

    def start(self) -> None:
        """Start the flight recorder if it was on when Studio closed."""
        self._apply_ring_settings()

    def check(self) -> None:
        """Restart the flight recorder if its process ended unexpectedly, and repeat active events.

        Called once a second. Active runs and alarms are sent to the flight recorder again, see
        `RecordedEvents.resend`.
        """
        self.client.check()
        self.events.resend("ring")

    def on_event(self, event: RecorderEvent | RecorderExited) -> None:
        """Apply an event of the recorder's process."""
        previous = self.client.state
        self.client.on_event(event)
        state = self.client.state
        if previous.phase == "starting" and state.phase == "recording":
            self._started_s = self._clock()
            self.events.resend("recording")
        if previous.phase and not state.phase:
            self._started_s = None
            if state.last_path is not None and state.last_path == previous.path:
                self.on_created(state.last_path, "recorded")
        for path in [each for each in self._pending_saves if each not in state.pending_saves]:
            on_done = self._pending_saves.pop(path)
            is_saved = state.last_path == path
            if is_saved:
                self.on_created(path, "kept")
            if on_done is not None:
                template = _("saved {file}") if is_saved else _("nothing saved: see the alerts")
                on_done(is_saved, template.format(file=path.name))

    def close(self) -> None:
        """Close the recorder. Its process finishes a recording in progress, even after Studio has exited."""
        self.client.close()

    def _save_setting(self, setting: Setting[T], value: T) -> None:
        with suppress(SettingsError):  # an alert reports that settings can't be saved
            self._settings.set_value(setting, value)


def saved_file_name(text: str) -> str:
    """Return the file name in a text such as "saved alarm-2026-11-27-10-00-00.mcap"; "" if there is none."""
    match = _SAVED_FILE_PATTERN.search(text)
    return match[0] if match is not None else ""
