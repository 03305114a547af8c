"""Commands for recording: start, stop, save the flight recorder, choose topics and folder."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from app.core.network.topics import split_key
from app.core.recording.topic_choice import RecordingChoice
from app.core.session import Session
from app.ui.intents import SelectRecording
from app.ui.shell.commands.shell import Shell
from app.ui.text.numbers import length_text, size_text
from app.ui.widgets.file_dialogs import FileDialogs
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.ui.shell.dialogs import record as record_sheet
else:
    record_sheet = lazy_module("app.ui.shell.dialogs.record")


class RecordCommands:
    """Handlers of the commands for recording, used by shortcuts, menus, the tool bar and the sheet."""

    def __init__(self, shell: Shell, session: Session, dialogs: FileDialogs) -> None:
        self._shell, self._session, self._dialogs = shell, session, dialogs
        self._recordings = session.recordings
        self._recordings.on_created = self._on_saved
        self._sheet: record_sheet.RecordSheet | None = None

    def toggle(self) -> None:
        """Start a recording with the last settings, or stop the current one."""
        if self._recordings.is_recording:
            self._recordings.stop()
        else:
            self._start()

    def start_and_open_sheet(self) -> None:
        """Start a recording with the last settings unless one is running, and open the sheet."""
        if not self._recordings.is_recording:
            self._start()
        self.open_sheet()

    def _start(self, choice: RecordingChoice | None = None) -> bool:
        reason = self._recordings.record(choice=choice)
        if reason and choice is None:
            self._shell.show_toast(reason, _("Choose topics to record"), self.open_sheet)
        elif reason:
            self._shell.show_toast(reason)
        elif self._session.live.master.kind != "connected":
            self._shell.show_toast(_("Recording starts as soon as a master appears"))
        return not reason

    def record_topic(self, key: str) -> bool:
        """Start a recording of a single topic, without changing the saved settings.

        Returns:
            False if the recording can't be started; a toast shows the reason.
        """
        network, topic = split_key(key)
        if network:
            self._shell.show_toast(_("You can only record topics of Studio's own network"))
            return False
        if not self._start(RecordingChoice("chosen", (topic,))):
            return False
        self._shell.show_toast(
            _("Recording {topic}").format(topic=topic), _("Stop recording"), self._recordings.stop
        )
        return True

    def open_sheet(self) -> None:
        """Open the sheet with topics and settings of the recording."""
        if self._sheet is None:
            shell = self._shell
            self._sheet = record_sheet.RecordSheet(
                shell.theme, shell.surface, self._session, self.save_last, shell.show_toast
            )
        self._sheet.open()

    def save_last(self) -> None:
        """Save the contents of the flight recorder as a recording.

        If the flight recorder is off, a toast offers to turn it on.
        """
        recordings = self._recordings
        if not recordings.ring_settings.is_on:
            self._shell.show_toast(
                _("The flight recorder is off: there is nothing to save"),
                _("Turn it on"),
                self._enable_flight_recorder,
            )
            return
        reason = recordings.save_last()
        if reason:
            self._shell.show_toast(reason)

    def _enable_flight_recorder(self) -> None:
        recordings = self._recordings
        recordings.set_ring_settings(replace(recordings.ring_settings, is_on=True))
        message = _("The flight recorder now keeps the last {count} s")
        self._shell.show_toast(message.format(count=recordings.ring_settings.seconds))

    def show(self, path: Path | None = None) -> None:
        """Show the recordings panel and select a recording in it, if one is given."""
        if self._sheet is not None:
            self._sheet.dismiss()  # the sheet may cover the panel
        if self._shell.request(SelectRecording(path)):
            self._shell.panel_focus.focus(self._shell.open_panel("recordings"))

    def show_for_export(self, path: Path) -> None:
        """Select a recording in the recordings panel, which can export a part of it.

        If the recording is in another folder, a toast offers to choose that folder.
        """
        if path.parent == self._recordings.folder:
            self.show(path)
        else:
            message = _("{file} is in another folder. Choose that folder for recordings first")
            self._shell.show_toast(message.format(file=path.name), _("Choose a folder"), self.ask_folder)

    def ask_folder(self) -> None:
        """Ask for the folder in which recordings are saved."""
        recordings = self._recordings

        def set_folder(folder: Path) -> None:
            recordings.set_folder(folder)
            self._shell.show_toast(_("Recordings are saved in {folder}").format(folder=folder))

        start_folder = recordings.folder
        self._dialogs.select_folder(str(start_folder if start_folder.is_dir() else Path.home()), set_folder)

    def _on_saved(self, path: Path, kind: str) -> None:
        if kind == "kept":
            message = _("Saved the last seconds: {file}").format(file=path.stem)
        else:
            state = self._recordings.client.state
            message = {
                "time": _("Recording stopped at the time limit: {file}, {length}, {size}"),
                "size": _("Recording stopped at the size limit: {file}, {length}, {size}"),
            }.get(state.reached_limit, _("Saved recording {file}: {length}, {size}"))
            message = message.format(
                file=path.stem, length=length_text(state.duration_s), size=size_text(state.size_bytes)
            )
        self._shell.show_toast(message, _("Show"), lambda: self.show(path))
