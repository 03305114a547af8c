"""Commands for replay: open and close a recording, play, add a bookmark."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QUrl

from app.core.session import Session
from app.core.storage.folders import default_recordings_folder
from app.ui.other_programs import open_externally
from app.ui.shell.commands.shell import Shell
from app.ui.widgets.file_dialogs import FileDialogs
from nep.errors import RecordingError
from nep.i18n import _

if TYPE_CHECKING:
    from app.core.recording.replay.replay import Replay

TIMELINE_PANEL = "timeline"


class ReplayCommands:
    """Handlers of the commands that show a recording in place of the live network."""

    def __init__(self, shell: Shell, session: Session, dialogs: FileDialogs) -> None:
        self._shell, self._session, self._dialogs = shell, session, dialogs

    def ask_open(self) -> None:
        """Ask for a recording and open it."""
        replay = self._session.replay
        start_folder = replay.path.parent if replay is not None else default_recordings_folder()
        self._dialogs.open_recording(str(start_folder), self.open)

    def open(self, path: Path) -> None:
        """Open a recording and show the timeline.

        A toast reports that the file doesn't exist; other errors are shown as an alert.
        """
        if not path.is_file():
            self._shell.show_toast(_("{file} no longer exists").format(file=path.name))
            return
        self._shell.show_layout("developer")
        self._session.open_recording(path)
        self._shell.open_panel(TIMELINE_PANEL)

    def return_to_live(self) -> None:
        """Close the recording and show the live network."""
        self._session.return_to_live()
        bench = self._shell.bench
        if bench is not None and TIMELINE_PANEL in bench.open_names():
            bench.docks[TIMELINE_PANEL].close()

    def show_folder(self, path: Path) -> None:
        """Open the folder of a recording in the file manager."""
        open_externally(QUrl.fromLocalFile(str(path.parent)))

    @property
    def _replay(self) -> Replay | None:
        return self._session.replay

    def toggle_playback(self) -> None:
        """Start the replay, or pause it."""
        if self._replay is not None:
            self._replay.toggle()

    def add_bookmark(self) -> None:
        """Add a bookmark at the playhead."""
        replay = self._replay
        if replay is None:
            return
        try:
            bookmark = replay.bookmark()
        except RecordingError as error:
            message = f"{error.reason[:1].upper()}{error.reason[1:]}."
            self._session.alerts.raise_alert(
                "recording:bookmark", "error", _("Can't save the bookmark."), message
            )
            return
        if bookmark is not None:
            self._shell.show_toast(_("Added a bookmark"), _("Undo"), lambda: replay.remove_bookmark(bookmark))
