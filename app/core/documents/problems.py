"""Problems of a behaviour as lines of the problem list; a missing robot is one line with its fixes."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from app.blocks import Problem
from app.blocks.fixes.replace_robot import asked_of, can_do, count_of, types_of
from app.robots.description.description import Robot
from nep.i18n import _, ngettext

CONNECT = "connect:"
MAX_FIXES = 2  # more don't fit into a line


@dataclass(frozen=True)
class Mend:
    """Fix offered for a problem: the label of the button, and the command that it runs."""

    words: str
    action: str


@dataclass(frozen=True)
class Listed:
    """Line of the problem list: the problem, its fixes (best first), and the number of affected blocks."""

    problem: Problem
    fixes: tuple[Mend, ...]
    blocks: int = 1

    @property
    def severity(self) -> str:
        """Severity: ``error``, ``warning`` or ``info``."""
        return self.problem.severity


def listed(
    problems: Sequence[Problem],
    workspace: Mapping[str, object],
    missing: Sequence[Robot],
    connected: Sequence[Robot],
    virtual_models: Collection[str],
    absent: Collection[str] = (),
) -> tuple[Listed, ...]:
    """Return the lines of the problem list.

    All blocks of a missing robot are one line with the number of disabled blocks. The fixes of that line are
    connected robots with the same actions, and a virtual robot of the same model.

    Args:
        absent: Ids of the disabled blocks (`Program.absent`).
    """
    found: list[Listed] = []
    place: dict[str, int] = {}
    grey = count_of(workspace, absent)
    known = {robot.name: robot for robot in missing}
    asked = asked_of(workspace)
    types = {robot.name: types_of(robot) for robot in connected} if known else {}
    for problem in problems:
        name = _missing(problem)
        if name is None:
            own = (Mend(problem.fix, problem.fix_action),) if problem.fix and problem.fix_action else ()
            found.append(Listed(problem, own))
        elif name not in place:
            place[name] = len(found)
            robot = known.get(name)
            able: list[Robot] = []
            if robot is not None:
                blocks = asked.get(name, frozenset())
                able = [each for each in connected if can_do(blocks, robot.model, each, types[each.name])]
            fixes = robot_fixes(name, robot, able, virtual_models)
            found.append(Listed(problem, fixes, max(1, grey.get(name, 0))))
    return tuple(_counted(each) for each in found)


def robot_fixes(
    name: str,
    robot: Robot | None,
    able: Sequence[Robot],
    virtual_models: Collection[str],
) -> tuple[Mend, ...]:
    """Return the fixes for a missing robot, best first.

    ``able`` are the robots that have the same actions.
    """
    if robot is None:
        return (_show_robots(name),)
    alike = [other for other in able if other.model == robot.model] or able
    fixes = [
        Mend(_("Use {robot}").format(robot=other.name), f"robot.use:{name}:{other.name}")
        for other in alike[:MAX_FIXES]
    ]
    if robot.model in virtual_models and len(fixes) < MAX_FIXES:
        fixes.append(Mend(_("Start a virtual {robot}").format(robot=name), f"robot.virtual:{name}"))
    return tuple(fixes) or (_show_robots(name),)


def _show_robots(name: str) -> Mend:
    # Studio can't switch a real robot on: it shows the present ones, and why others are missing.
    return Mend(_("Show the robots"), f"{CONNECT}{name}")


def _missing(problem: Problem) -> str | None:
    action = problem.fix_action or ""
    return action.removeprefix(CONNECT) if action.startswith(CONNECT) else None


def _counted(line: Listed) -> Listed:
    # A single block is named; several blocks are counted.
    if line.blocks == 1:
        return line
    name = _missing(line.problem) or ""
    subject = ngettext("{count} block", "{count} blocks", line.blocks).format(count=line.blocks)
    sentence = _("{robot} is not connected, so {block} will be skipped.").format(robot=name, block=subject)
    return replace(line, problem=replace(line.problem, subject=subject, sentence=sentence, icon="bot"))
