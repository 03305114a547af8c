"""Motion permission: the user is asked once for each real robot before its first motion.

Virtual robots need no permission if Studio knows their programs (`app.core.robots.launcher`). All ways
to make a robot act are checked here: forms, palette, keys and programs, including programs that publish
on a robot's topics. Only Stop is not checked. A permission is valid for the robot's current program; if
the user chooses *always*, it is valid for the robot's name, model, program and computer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

from app.blocks.model.program import Program
from app.core.storage.settings import Settings
from app.errors import AppError
from app.robots.description.description import Robot
from app.robots.identity import Identity
from nep.i18n import _, format_list, ngettext, pgettext
from nep.programs.robots.moving import RIZE_COMMAND_TOPIC

MAX_NAMED_ACTIONS = 4


class MayNotMoveError(AppError):
    """Raised when robots have no permission to move and the user is being asked."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        super().__init__(
            _("{robots} can't move yet; answer the question above first").format(
                robots=format_list(list(names))
            )
        )


@dataclass(frozen=True)
class PermissionQuestion:
    """Question to the user about the motion of robots.

    Attributes:
        moving_actions: Titles of the actions that move a robot, by robot.
        on_allow: Called if the user allows the motion.
        unknown_robots: Robots without a readable description, or topics of unknown robots, that would move
            too.
        reason: Sentence about the origin of the command, or "" for a command of the user.
    """

    moving_actions: Mapping[str, tuple[str, ...]]
    on_allow: Callable[[], object]
    unknown_robots: tuple[str, ...] = ()
    reason: str = ""

    @property
    def names(self) -> tuple[str, ...]:
        """Display names of all robots in the question."""
        return (*self.moving_actions, *map(_unknown_robot_label, self.unknown_robots))

    @property
    def title(self) -> str:
        """Title of the question, such as "Allow Rover to move?"."""
        return _("Allow {robots} to move?").format(robots=format_list(list(self.names)))

    @property
    def message(self) -> str:
        """Text about the motion and how to stop it."""
        sentences = [self.reason] if self.reason else []
        sentences += [
            ngettext("{actions} moves {robot}.", "{actions} move {robot}.", len(actions)).format(
                actions=format_list(actions), robot=name
            )
            for name, actions in self.moving_actions.items()
        ]
        if self.unknown_robots:
            names = format_list([_unknown_robot_label(each) for each in self.unknown_robots])
            template = _("The message may move {robot}, which Studio doesn't know.")
            sentences.append(template.format(robot=names))
        return _("{moves} Make sure nobody is in the way. Press F12 to stop at any time.").format(
            moves=" ".join(sentences)
        )


class MotionPermission:
    """Permissions of robots to move. Not thread-safe; use it from the main thread."""

    def __init__(
        self,
        settings: Settings | None = None,
        identity_of: Callable[[str], Identity | None] = lambda _name: None,
    ) -> None:
        # `settings` store the *always* permissions; `identity_of` returns a robot's program.
        self._settings, self._identity_of = settings, identity_of
        self._allowed_keys: set[str] = set()
        self.allowed_unknown_robots: frozenset[str] = frozenset()
        """Allowed robots without a readable description, and topics of unknown robots that were allowed."""
        self._question_keys: tuple[tuple[str, str], ...] = ()
        self.question: PermissionQuestion | None = None
        """Open question, or None."""
        self.revision = 0

    def is_allowed(self, robot: Robot) -> bool:
        """Return True if this robot may be moved without asking the user."""
        return (
            robot.virtual
            or self._program_key(robot) in self._allowed_keys
            or self._key(robot) in self._always_allowed()
        )

    def request_permission(
        self,
        requested: Iterable[tuple[Robot, Sequence[str]]],
        on_allow: Callable[[], object],
        unknown_robots: Iterable[str] = (),
        reason: str = "",
    ) -> bool:
        """Return True if the robots may move now; otherwise ask the user and return False.

        A question that is still open is replaced.

        Args:
            requested: Robots and the actions that they should execute.
            on_allow: Called if the user allows the motion.
            unknown_robots: Robots without a readable description, or topics of unknown robots, that would
                move too.
            reason: Sentence about the origin of the command, or "" for a command of the user.
        """
        unconfirmed = [
            (robot, risky_action_titles(robot, actions))
            for robot, actions in requested
            if not self.is_allowed(robot)
        ]
        moving = [(robot, titles) for robot, titles in unconfirmed if titles]
        unconfirmed_names = tuple(name for name in unknown_robots if name not in self.allowed_unknown_robots)
        if not moving and not unconfirmed_names:
            return True
        self._question_keys = tuple((self._program_key(robot), self._key(robot)) for robot, _key in moving)
        self.question = PermissionQuestion(
            {robot.name: titles for robot, titles in moving}, on_allow, unconfirmed_names, reason
        )
        self.revision += 1
        return False

    def answer(self, *, is_allowed: bool, is_permanent: bool = False) -> None:
        """Apply the user's answer to the question.

        Args:
            is_allowed: True to allow the motion and call `PermissionQuestion.on_allow`.
            is_permanent: True to save the permission.

        Raises:
            SettingsError: The permission can't be saved.
        """
        question, self.question = self.question, None
        self.revision += 1
        if question is None or not is_allowed:
            return
        self._allowed_keys.update(program_key for program_key, _key in self._question_keys)
        self.allowed_unknown_robots |= set(question.unknown_robots)
        try:
            if is_permanent and self._settings is not None:
                keys = {*self._always_allowed(), *(key for _program_key, key in self._question_keys)}
                self._settings.motion_permissions = tuple(sorted(keys))
        finally:
            question.on_allow()

    def withdraw(self) -> None:
        """Close the question without an answer, after Stop was pressed or the robot disconnected."""
        if self.question is not None:
            self.question = None
            self.revision += 1

    def revoke_all(self) -> None:
        """Revoke all permissions, including saved ones.

        Raises:
            SettingsError: The settings can't be written. Saved permissions remain valid.
        """
        self._allowed_keys.clear()
        self.allowed_unknown_robots = frozenset()
        self.revision += 1
        if self._settings is not None:
            self._settings.motion_permissions = ()

    def _key(self, robot: Robot) -> str:
        # Key of *always*: another program that announces this name doesn't match.
        identity = self._identity_of(robot.name)
        return f"{robot.name} ({robot.model})" + (
            f", {identity.display_name}" if identity is not None else ""
        )

    def _program_key(self, robot: Robot) -> str:
        # Key of a permission for this very program until it is restarted.
        identity = self._identity_of(robot.name)
        return f"{self._key(robot)} {identity.node_id if identity is not None else ''}"

    def _always_allowed(self) -> Sequence[str]:
        return self._settings.motion_permissions if self._settings is not None else ()


def _unknown_robot_label(name: str) -> str:
    # A robot of which only the name or a topic is known.
    return _("the robot on {topic}").format(topic=name) if "/" in name or name == RIZE_COMMAND_TOPIC else name


def risky_action_titles(robot: Robot, actions: Iterable[str]) -> tuple[str, ...]:
    """Return the quoted titles of the actions that move the robot, without duplicates.

    At most `MAX_NAMED_ACTIONS` titles are returned, followed by “more” if there are others.
    """
    risky_titles = [
        action.title for name in actions if (action := robot.action(name)) is not None and action.risk
    ]
    titles = [f"“{title}”" for title in dict.fromkeys(risky_titles)]
    return (
        (*titles[:MAX_NAMED_ACTIONS], pgettext("after a list", "more"))
        if len(titles) > MAX_NAMED_ACTIONS
        else tuple(titles)
    )


def actions_by_robot(program: Program, robots: Iterable[Robot]) -> list[tuple[Robot, Sequence[str]]]:
    """Return the robots that a program uses and the actions that it invokes.

    If the program publishes on the topics of a robot directly, all actions of that robot are included.
    """
    actions_by_name, moved_names = program.actions, program.moves
    return [
        (
            robot,
            [action.name for action in robot.actions]
            if actions_by_name is None or robot.name in moved_names
            else actions_by_name.get(robot.name, ()),
        )
        for robot in robots
    ]
