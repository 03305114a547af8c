"""Which source shows: the live network, or a recording with its name and length; it opens a menu."""

from __future__ import annotations

from PySide6.QtGui import QColor

from app.core.replay.scale import span_words
from app.core.session import Session
from app.ui.shell.actions.actions import Actions
from app.ui.theme.theme import Theme
from app.ui.widgets import Button, MenuButton
from app.ui.widgets.menus import Menu, drop_below
from nep.i18n import _

LIVE_ICON, RECORDING_ICON = "radio-tower", "history"


class SourceSwitch(MenuButton):
    """Says what shows, and lets a person choose; `back` stands beside it while a recording shows."""

    def __init__(self, theme: Theme, session: Session, actions: Actions) -> None:
        super().__init__(theme, _("Live network"), LIVE_ICON, size="small")
        self._session, self._actions = session, actions
        self._is_recording = False
        self.back = Button(theme, _("Back to live"), LIVE_ICON, size="small")
        for button in (self, self.back):
            button.let_shrink()
        actions.bind(self.back, "replay.live")
        self.clicked.connect(self._drop)

    @property
    def is_recording(self) -> bool:
        """Whether a recording shows."""
        return self._is_recording

    def refresh(self) -> None:
        """Say what is so now."""
        replay = self._session.replay
        self._is_recording = replay is not None
        if replay is None:
            self.set_word(_("Live network"), LIVE_ICON)
            return
        there = replay.opened is not None
        length = span_words(replay.end_ns - replay.start_ns, digits=0) if there else ""
        self.set_word(f"{replay.name}  {length}".strip(), RECORDING_ICON)

    def _drop(self) -> None:
        menu = Menu(self._theme, self)
        menu.addActions([self._actions["replay.open"], self._actions["replay.live"]])
        drop_below(menu, self)

    def _look(self) -> tuple[QColor | None, QColor | None, QColor]:
        if self._is_recording and self.isEnabled():
            colour = self._theme.colour
            return colour("accentTint"), colour("accent"), colour("accentText")
        return super()._look()
