"""Static detection of scripts that use the same resource of a robot at the same time.

Two "when started" scripts run in parallel; if both move the base of a robot, one action replaces the other.
Only certain conflicts are reported: actions after a condition or a wait may be timed correctly, and event
scripts may interrupt other scripts on purpose. `app.blocks.runtime.robot_handle` reports these conflicts when
they occur.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from app.blocks.compiler.lowering import Function
from app.blocks.model.workspace import PlacedBlock, Workspace
from app.blocks.toolbox.catalogue import Catalogue
from app.robots.description.description import Action

START_BLOCK = "events_started"
IMMEDIATE, LATER, UNCERTAIN = range(3)
_ENDLESS_BLOCKS = frozenset({"control_forever", "control_while"})
_CONDITIONAL_BLOCKS = frozenset({"control_if", "control_if_else"})
_TIMING_OF_WAIT_BLOCKS = {
    "control_wait": LATER,
    "control_wait_until": UNCERTAIN,
    "control_wait_until_at_most": UNCERTAIN,
}
_REPLACE = "replace"


@dataclass(frozen=True)
class ActionUse:
    """Action block of a robot whose action uses a resource.

    Attributes:
        block: Block in the workspace.
        robot: Name of the robot.
        action: Description of the action.
        timing: `IMMEDIATE` (starts with the script), `LATER` (after other actions or waits) or `UNCERTAIN`.
        is_endless: True inside a loop that never ends.
    """

    block: PlacedBlock
    robot: str
    action: Action
    timing: int
    is_endless: bool


@dataclass(frozen=True)
class Conflict:
    """Two blocks of two scripts that use the same resource of a robot at the same time.

    Attributes:
        first: Block in the first script.
        second: Block in the second script.
        resource: Name of the resource.
        reordering: Ids of two start blocks: the script of the first one can be moved to the end of the script
            of the second one. None if both scripts run forever.
    """

    first: ActionUse
    second: ActionUse
    resource: str
    reordering: tuple[str, str] | None


class ConflictFinder:
    """Finder of conflicts between "when started" scripts, including the functions that the scripts call."""

    def __init__(
        self, workspace: Workspace, catalogue: Catalogue, function: Callable[[PlacedBlock], Function | None]
    ) -> None:
        self._workspace, self._catalogue, self._function = workspace, catalogue, function

    def conflicts(self) -> Iterator[Conflict]:
        """Yield the conflicts of all pairs of scripts; for each pair, one per robot and resource."""
        scripts = [
            script
            for script in self._workspace.scripts
            if script[0].type == START_BLOCK and script[0].is_enabled
        ]
        if len(scripts) < 2:
            return
        uses_by_script = [self._find_action_uses(script[1:])[0] for script in scripts]
        for first_index, second_index in itertools.combinations(range(len(scripts)), 2):
            reported: set[tuple[str, str]] = set()
            for first, second in itertools.product(uses_by_script[first_index], uses_by_script[second_index]):
                for resource in _shared_resources(first, second):
                    if (first.robot, resource) not in reported:
                        reported.add((first.robot, resource))
                        yield Conflict(
                            first,
                            second,
                            resource,
                            self._possible_reordering(scripts[first_index], scripts[second_index]),
                        )

    def _find_action_uses(
        self,
        chain: Sequence[PlacedBlock],
        timing: int = IMMEDIATE,
        *,
        is_endless: bool = False,
        call_stack: tuple[str, ...] = (),
    ) -> tuple[list[ActionUse], int]:
        uses: list[ActionUse] = []
        for placed_block in chain:
            if not placed_block.is_enabled:
                continue
            robot_action = self._robot_action(placed_block)
            if robot_action is not None:
                uses.append(ActionUse(placed_block, *robot_action, timing, is_endless))
                timing = max(timing, LATER)  # actions take time
            is_condition = placed_block.type.partition(":")[0] in _CONDITIONAL_BLOCKS
            is_endless_inside = is_endless or placed_block.type in _ENDLESS_BLOCKS
            for inner in placed_block.inputs.values():
                inner_uses, after = self._find_action_uses(
                    inner,
                    UNCERTAIN if is_condition else timing,
                    is_endless=is_endless_inside,
                    call_stack=call_stack,
                )
                uses += inner_uses
                timing = max(timing, (LATER if inner_uses else timing) if is_condition else after)
            function = self._function(placed_block)
            if function is not None and function.definition.id not in call_stack:
                body = function.definition.inputs.get("BODY", ())
                inner_uses, timing = self._find_action_uses(
                    body, timing, is_endless=is_endless, call_stack=(*call_stack, function.definition.id)
                )
                uses += inner_uses
            timing = max(timing, _TIMING_OF_WAIT_BLOCKS.get(placed_block.type, IMMEDIATE))
        return uses, timing

    def _robot_action(self, placed_block: PlacedBlock) -> tuple[str, Action] | None:
        block = self._catalogue.blocks.get(placed_block.type)
        if block is None or block.robot is None or block.robot.kind != "action":
            return None
        name = placed_block.field_text("ROBOT")
        robot = self._catalogue.connected.get(name)
        action = robot.action(block.robot.name) if robot is not None else None
        return (name, action) if action is not None and action.uses else None

    def _possible_reordering(
        self, script: Sequence[PlacedBlock], other: Sequence[PlacedBlock]
    ) -> tuple[str, str] | None:
        if not self._is_endless(script):
            return other[0].id, script[0].id
        return None if self._is_endless(other) else (script[0].id, other[0].id)

    def _is_endless(self, script: Sequence[PlacedBlock]) -> bool:
        block = self._catalogue.blocks.get(script[-1].type)
        return block is None or block.shape == "cap"


def _shared_resources(first: ActionUse, second: ActionUse) -> Sequence[str]:
    if first.robot != second.robot or not _run_simultaneously(first, second):
        return ()
    if not any(
        winner.action.on_busy == _REPLACE and loser.action.cancellable
        for winner, loser in ((first, second), (second, first))
    ):
        return ()  # the robot runs them one after the other
    return [resource for resource in first.action.uses if resource in second.action.uses]


def _run_simultaneously(first: ActionUse, second: ActionUse) -> bool:
    if UNCERTAIN in (first.timing, second.timing):
        return False
    if first.timing == second.timing == IMMEDIATE:
        return True
    if LATER in (first.timing, second.timing) and first.timing != second.timing:
        early = first if first.timing == IMMEDIATE else second
        return early.is_endless
    return first.is_endless and second.is_endless
