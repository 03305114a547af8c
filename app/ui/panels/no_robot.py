"""What a panel about robots says while there is none: that none is connected, or that one is coming."""

from __future__ import annotations

from collections.abc import Sequence

from app.core.run.view import connected_words
from app.ui.widgets import EmptyAction, EmptyState
from nep.i18n import _


class NoRobot:
    """Keeps the words of an `EmptyState`: nobody reads that there is no robot just after starting one."""

    def __init__(self, empty: EmptyState, title: str, text: str, actions: Sequence[EmptyAction] = ()) -> None:
        """The words and the next steps while no robot is coming; the empty state has them already."""
        self._empty, self._title, self._text, self._actions = empty, title, text, tuple(actions)
        self._coming: tuple[str, ...] = ()

    def tell(self, coming: tuple[str, ...]) -> None:
        """These robots are being started; call it with every refresh while there is none."""
        if coming == self._coming:
            return
        self._coming = coming
        if coming:
            self._empty.say(connected_words((), coming), _("A virtual robot takes a few seconds to start."))
            self._empty.set_actions(())
        else:
            self._empty.say(self._title, self._text)
            self._empty.set_actions(self._actions)
