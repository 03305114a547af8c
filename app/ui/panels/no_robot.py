"""Empty state of panels without a robot."""

from __future__ import annotations

from collections.abc import Sequence

from app.core.run.view import connected_text
from app.ui.widgets import EmptyAction, EmptyState
from nep.i18n import _


class NoRobotController:
    """Controller of an empty state that says "no robot" or "robot is starting".

    Args:
        empty: Empty state to change.
        title: Title without a robot.
        text: Text without a robot.
        actions: Actions without a robot.
    """

    def __init__(self, empty: EmptyState, title: str, text: str, actions: Sequence[EmptyAction] = ()) -> None:
        self._empty, self._title, self._text, self._actions = empty, title, text, tuple(actions)
        self._starting: tuple[str, ...] = ()

    def set_starting(self, robot_names: tuple[str, ...]) -> None:
        """Set the names of the robots that are starting; call on every refresh without a robot."""
        if robot_names == self._starting:
            return
        self._starting = robot_names
        if robot_names:
            self._empty.set_texts(
                connected_text((), robot_names), _("A virtual robot takes a few seconds to start.")
            )
            self._empty.set_actions(())
        else:
            self._empty.set_texts(self._title, self._text)
            self._empty.set_actions(self._actions)
