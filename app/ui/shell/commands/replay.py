"""What the commands about recordings do: which one is shown, and where in it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QUrl

from app.core.session import Session
from app.ui.other_programs import open_outside
from app.ui.shell.commands.shell import Shell
from app.ui.widgets.file_dialogs import FileDialogs
from nep.errors import RecordingError
from nep.i18n import _
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.core.recording import folder
    from app.core.recording.replay.replay import Replay
else:
    folder = lazy_module("app.core.recording.folder")

TIMELINE = "timeline"


class ReplayCommands:
    """Opens recordings in place of the live network, and leads back."""

    def __init__(self, shell: Shell, session: Session, asks: FileDialogs) -> None:
        self._shell, self._session, self._asks = shell, session, asks

    def ask_open(self) -> None:
        """Let a person choose a recording, and open it."""
        replay = self._session.replay
        place = replay.path.parent if replay is not None else folder.usual_folder()
        self._asks.open_recording(str(place), self.open)

    def open(self, path: Path) -> None:
        """Show a recording, with its time line; what is wrong with it becomes an alert."""
        if not path.is_file():
            self._shell.say(_("{file} no longer exists").format(file=path.name))
            return
        self._shell.show_layout("developer")
        self._session.open_recording(path)
        self._shell.open_panel(TIMELINE)

    def back_to_live(self) -> None:
        """Show the live network again, and close the recording."""
        self._session.back_to_live()
        bench = self._shell.bench
        if bench is not None and TIMELINE in bench.open_names():
            bench.docks[TIMELINE].close()

    def show_folder(self, path: Path) -> None:
        """Show where a recording is."""
        open_outside(QUrl.fromLocalFile(str(path.parent)))

    @property
    def _replay(self) -> Replay | None:
        return self._session.replay

    def play(self) -> None:
        """Play, or pause."""
        if self._replay is not None:
            self._replay.toggle()

    def bookmark(self) -> None:
        """Make a bookmark at the playhead."""
        replay = self._replay
        if replay is None:
            return
        try:
            made = replay.bookmark()
        except RecordingError as error:
            sentence = f"{error.reason[:1].upper()}{error.reason[1:]}."
            self._session.alerts.put("recording:bookmark", "error", _("Can't save the bookmark."), sentence)
            return
        if made is not None:
            self._shell.say(_("Added a bookmark"), _("Undo"), lambda: replay.remove_bookmark(made))
