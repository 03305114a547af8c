"""Requests to run a behaviour, or a single stack of a behaviour."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

from app.blocks.model.program import Program
from app.blocks.model.stack import SHOW_BLOCK_ID, Stack
from app.core.projects.open_project import OpenProject
from app.intents import ConnectRobot
from app.robots.description.description import Robot
from app.robots.description.inputs import display_unit
from nep.i18n import _


class OpenBehaviours(Protocol):
    """Part of the interface of `OpenProjects` that a run uses."""

    @property
    def current(self) -> OpenProject:
        """Behaviour of the current tab, to which Run applies."""

    def title(self, project: OpenProject) -> str:
        """Return the title of a behaviour."""


@dataclass(frozen=True, slots=True)
class RequestedRun:
    """Request to run a behaviour or a single stack of it.

    Attributes:
        document: Behaviour to run.
        starts_paused: True to pause before the first block.
        stack: Stack to run; None for the whole behaviour.
    """

    document: OpenProject
    starts_paused: bool = False
    stack: Stack | None = None

    def program(self) -> Program | None:
        """Return the program to run; None if the stack no longer exists."""
        return self.document.program() if self.stack is None else self.document.compile_trial(self.stack)

    @property
    def has_value(self) -> bool:
        """True if the stack is a value block. The program then prints the value."""
        return self.stack is not None and self.stack.is_value

    def unit(self, program: Program, robots: Iterable[Robot]) -> str:
        """Return the unit of a tried sensor value; "" for any other block."""
        if (
            self.stack is None
            or len(program.sensors) != 1
            or "_get_" not in self.stack.first_block_type(self.document.workspace)
        ):
            return ""
        name, sensor_name = program.sensors[0]
        sensors = (robot.sensor(sensor_name) for robot in robots if robot.name == name)
        sensor = next((each for each in sensors if each is not None), None)
        if sensor is None or sensor.kind == "object":
            return ""
        return display_unit(sensor.unit) or ""

    def problems(self, program: Program) -> dict[str, str]:
        """Return the errors that prevent the start, by block id.

        Missing robots don't prevent a whole behaviour from running.
        """
        errors = {each.block_id: each.message for each in program.problems if each.severity == "error"}
        block_errors = {block: message for block, message in errors.items() if block}
        if self.stack is None or block_errors:
            return {block: message for block, message in block_errors.items() if block != SHOW_BLOCK_ID}
        return _missing_robot_errors(program, self.stack)

    def label(self, program: Program) -> str:
        """Return the label of the tried block; "" for a whole behaviour."""
        if self.stack is None:
            return ""
        labels: Mapping[str, str] = program.labels
        return labels.get(self.stack.id) or next(
            (label for block, label in labels.items() if block != SHOW_BLOCK_ID), program.name
        )


def _missing_robot_errors(program: Program, stack: Stack) -> dict[str, str]:
    # A block whose robot is missing would do nothing.
    if stack.id not in program.absent:
        return {}
    fixes = (each.fix_action for each in program.problems if each.block_id == stack.id)
    robot = next((fix.name for fix in fixes if isinstance(fix, ConnectRobot)), "")
    if not robot:
        return {stack.id: _("The robot isn't connected, so these blocks can't be tried.")}
    return {stack.id: _("{robot} isn't connected, so these blocks can't be tried.").format(robot=robot)}
