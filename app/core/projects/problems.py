"""Problems of a behaviour as rows of the problem list. A missing robot is one row with its fixes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from app.blocks.fixes.replace_robot import (
    block_counts_by_robot,
    block_types_by_robot,
    block_types_of,
    supports_blocks,
)
from app.blocks.model.program import Problem
from app.blocks.model.project import Page
from app.intents import ConnectRobot, Intent, ReplaceRobot, StartVirtualRobot
from app.robots.description.description import Robot
from nep.i18n import _, ngettext

MAX_FIXES = 2  # more don't fit into a line


@dataclass(frozen=True)
class Fix:
    """Fix offered for a problem.

    Attributes:
        label: Label of the button.
        action: Intent of the button.
    """

    label: str
    action: Intent


@dataclass(frozen=True)
class ProblemLine:
    """Row of the problem list.

    Attributes:
        problem: Problem that is shown.
        fixes: Fixes, best first.
        block_count: Number of affected blocks.
    """

    problem: Problem
    fixes: tuple[Fix, ...]
    block_count: int = 1

    @property
    def severity(self) -> str:
        """Severity of the problem: ``error``, ``warning`` or ``info``."""
        return self.problem.severity


def problem_lines(
    problems: Sequence[Problem],
    pages: Sequence[Page],
    missing: Sequence[Robot],
    connected: Sequence[Robot],
    virtual_models: Collection[str],
    absent: Collection[str] = (),
) -> tuple[ProblemLine, ...]:
    """Return the rows of the problem list.

    All problems of a missing robot are combined into one row with the number of disabled blocks; see
    `robot_fixes` for the fixes of such a row.

    Args:
        problems: Problems that the compiler found.
        pages: Pages of the project.
        missing: Robots that the behaviour uses and that are not connected.
        connected: Connected robots.
        virtual_models: Models that are available as virtual robots.
        absent: Ids of the disabled blocks (`Program.absent`).
    """
    lines: list[ProblemLine] = []
    line_indexes: dict[str, int] = {}
    disabled_counts = _disabled_counts(pages, absent)
    missing_by_name = {robot.name: robot for robot in missing}
    types_by_robot = _block_types(pages)
    types = {robot.name: block_types_of(robot) for robot in connected} if missing_by_name else {}
    for problem in problems:
        name = _missing_robot_name(problem)
        if name is None:
            problem_fixes = (
                (Fix(problem.fix, problem.fix_action),) if problem.fix and problem.fix_action else ()
            )
            lines.append(ProblemLine(problem, problem_fixes))
        elif name not in line_indexes:
            line_indexes[name] = len(lines)
            robot = missing_by_name.get(name)
            suitable_robots: list[Robot] = []
            if robot is not None:
                blocks = types_by_robot.get(name, frozenset())
                suitable_robots = [
                    each for each in connected if supports_blocks(blocks, robot.model, each, types[each.name])
                ]
            fixes = robot_fixes(name, robot, suitable_robots, virtual_models)
            lines.append(ProblemLine(problem, fixes, max(1, disabled_counts.get(name, 0))))
    return tuple(_with_block_count(each) for each in lines)


def _disabled_counts(pages: Sequence[Page], absent: Collection[str]) -> Mapping[str, int]:
    counts: Counter[str] = Counter()
    for page in pages if absent else ():
        prefix = page.block_prefix
        ids = {id.removeprefix(prefix) for id in absent if id.startswith(prefix)}
        counts.update(block_counts_by_robot(page.workspace.blocks, ids))
    return counts


def _block_types(pages: Sequence[Page]) -> Mapping[str, frozenset[str]]:
    types: dict[str, frozenset[str]] = {}
    for page in pages:
        for robot, page_types in block_types_by_robot(page.workspace.blocks).items():
            types[robot] = types.get(robot, frozenset()) | page_types
    return types


def robot_fixes(
    name: str,
    robot: Robot | None,
    suitable_robots: Sequence[Robot],
    virtual_models: Collection[str],
) -> tuple[Fix, ...]:
    """Return the fixes for a missing robot, best first.

    These are at most `MAX_FIXES` connected robots, preferably of the same model, and a virtual robot of
    the same model. If there is none of them, the only fix shows the robots.

    Args:
        name: Name of the missing robot.
        robot: Missing robot; None if it has no description.
        suitable_robots: Connected robots that support all blocks that use the missing robot.
        virtual_models: Models that are available as virtual robots.
    """
    if robot is None:
        return (_show_robots_fix(name),)
    preferred_robots = [other for other in suitable_robots if other.model == robot.model] or suitable_robots
    fixes = [
        Fix(_("Use {robot}").format(robot=other.name), ReplaceRobot(name, other.name))
        for other in preferred_robots[:MAX_FIXES]
    ]
    if robot.model in virtual_models and len(fixes) < MAX_FIXES:
        fixes.append(Fix(_("Start a virtual {robot}").format(robot=name), StartVirtualRobot(name)))
    return tuple(fixes) or (_show_robots_fix(name),)


def _show_robots_fix(name: str) -> Fix:
    # Studio can't switch a real robot on: it shows the present ones, and why others are missing.
    return Fix(_("Show the robots"), ConnectRobot(name))


def _missing_robot_name(problem: Problem) -> str | None:
    return problem.fix_action.name if isinstance(problem.fix_action, ConnectRobot) else None


def _with_block_count(line: ProblemLine) -> ProblemLine:
    # A single block is named; several blocks are counted.
    if line.block_count == 1:
        return line
    name = _missing_robot_name(line.problem) or ""
    subject = ngettext("{count} block", "{count} blocks", line.block_count).format(count=line.block_count)
    message = _("{robot} isn't connected, so {block} will be skipped.").format(robot=name, block=subject)
    return replace(line, problem=replace(line.problem, subject=subject, message=message, icon="bot"))
