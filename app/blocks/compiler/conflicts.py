"""Static detection of scripts that use the same resource of a robot at the same time.

Two "when started" scripts run in parallel; if both move the base of a robot, one action replaces the other.
Only certain conflicts are reported: actions after a condition or a wait may be timed correctly, and event
scripts may interrupt other scripts on purpose. Such conflicts are reported when they occur
(`app.blocks.runtime.robot_handle`).
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from app.blocks.compiler.lowering import Function
from app.blocks.model.workspace import Placed, Workspace
from app.blocks.toolbox.catalogue import Catalogue
from app.robots.description.description import Action

STARTED = "events_started"
IMMEDIATE, LATER, UNCERTAIN = range(3)
_ENDLESS = frozenset({"control_forever", "control_while"})
_CONDITIONS = frozenset({"control_if", "control_if_else"})
_WAITS = {"control_wait": LATER, "control_wait_until": UNCERTAIN, "control_wait_until_at_most": UNCERTAIN}
_REPLACES = "replace"


@dataclass(frozen=True)
class UsedPart:
    """Action block of a robot; ``endless`` is True inside a loop that never ends."""

    placed: Placed
    robot: str
    action: Action
    when: int
    endless: bool


@dataclass(frozen=True)
class Conflict:
    """Two blocks of two scripts that use the same resource of a robot at the same time.

    ``put`` are the start block of the script that can be moved to the end of the other one, and the start
    block of the other one; None if both run forever.
    """

    first: UsedPart
    second: UsedPart
    part: str
    put: tuple[str, str] | None


class ConflictFinder:
    """Search through the start scripts of a workspace and the functions that they call."""

    def __init__(
        self, workspace: Workspace, catalogue: Catalogue, function: Callable[[Placed], Function | None]
    ) -> None:
        self._workspace, self._catalogue, self._function = workspace, catalogue, function

    def conflicts(self) -> Iterator[Conflict]:
        """Yield each conflict between two scripts, once for each resource of a robot."""
        scripts = [
            script for script in self._workspace.scripts if script[0].type == STARTED and script[0].enabled
        ]
        if len(scripts) < 2:
            return
        used = [self._used(script[1:])[0] for script in scripts]
        for one, other in itertools.combinations(range(len(scripts)), 2):
            told: set[tuple[str, str]] = set()
            for first, second in itertools.product(used[one], used[other]):
                for part in _shared_parts(first, second):
                    if (first.robot, part) not in told:
                        told.add((first.robot, part))
                        yield Conflict(first, second, part, self._order(scripts[one], scripts[other]))

    def _used(
        self,
        chain: Sequence[Placed],
        when: int = IMMEDIATE,
        *,
        endless: bool = False,
        deep: tuple[str, ...] = (),
    ) -> tuple[list[UsedPart], int]:
        used: list[UsedPart] = []
        for placed in chain:
            if not placed.enabled:
                continue
            found = self._part(placed)
            if found is not None:
                used.append(UsedPart(placed, *found, when, endless))
                when = max(when, LATER)  # actions take time
            is_condition = placed.type.partition(":")[0] in _CONDITIONS
            loops = endless or placed.type in _ENDLESS
            for inner in placed.inputs.values():
                inside, after = self._used(
                    inner, UNCERTAIN if is_condition else when, endless=loops, deep=deep
                )
                used += inside
                when = max(when, (LATER if inside else when) if is_condition else after)
            called = self._function(placed)
            if called is not None and called.placed.id not in deep:
                body = called.placed.inputs.get("BODY", ())
                inside, when = self._used(body, when, endless=endless, deep=(*deep, called.placed.id))
                used += inside
            when = max(when, _WAITS.get(placed.type, IMMEDIATE))
        return used, when

    def _part(self, placed: Placed) -> tuple[str, Action] | None:
        block = self._catalogue.blocks.get(placed.type)
        if block is None or block.robot is None or block.robot.kind != "action":
            return None
        name = placed.field_id("ROBOT")
        robot = self._catalogue.connected.get(name)
        action = robot.action(block.robot.name) if robot is not None else None
        return (name, action) if action is not None and action.uses else None

    def _order(self, one: Sequence[Placed], other: Sequence[Placed]) -> tuple[str, str] | None:
        if not self._is_endless(one):
            return other[0].id, one[0].id
        return None if self._is_endless(other) else (one[0].id, other[0].id)

    def _is_endless(self, script: Sequence[Placed]) -> bool:
        block = self._catalogue.blocks.get(script[-1].type)
        return block is None or block.shape == "cap"


def _shared_parts(first: UsedPart, second: UsedPart) -> Sequence[str]:
    if first.robot != second.robot or not _at_same_time(first, second):
        return ()
    if not any(
        winner.action.on_busy == _REPLACES and loser.action.cancellable
        for winner, loser in ((first, second), (second, first))
    ):
        return ()  # the robot runs them one after the other
    return [part for part in first.action.uses if part in second.action.uses]


def _at_same_time(first: UsedPart, second: UsedPart) -> bool:
    if UNCERTAIN in (first.when, second.when):
        return False
    if first.when == second.when == IMMEDIATE:
        return True
    if LATER in (first.when, second.when) and first.when != second.when:
        early = first if first.when == IMMEDIATE else second
        return early.endless
    return first.endless and second.endless
