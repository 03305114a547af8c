"""Definition of the six first steps, and detection of completed ones."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from nep.i18n import lazy

START_BLOCK = "events_started"
SAY, TURN = "_do_say", "_do_turn"
Script = tuple[tuple[str, str], ...]
"""Blocks of a script, as pairs of type and id."""


@dataclass(frozen=True)
class TutorialStep:
    """Step of the tutorial.

    Attributes:
        id: Id of the step in the settings.
        text: Sentence with the names of blocks in braces, such as ``{start}``.
        hint: Sentence that explains where to find the block or button.
        block_suffix: Suffix of the type of the block to drag, or "".
        button_command: Command of the button to press, or "".
    """

    id: str
    text: str
    hint: str
    block_suffix: str = ""
    button_command: str = ""


STEPS: tuple[TutorialStep, ...] = (
    TutorialStep(
        "robot", lazy("Use the virtual robot"), lazy("It comes with Studio."), button_command="robots.virtual"
    ),
    TutorialStep(
        "start",
        lazy("Drag “{start}” onto the page"),
        lazy("You'll find it under Events, on the left."),
        block_suffix=START_BLOCK,
    ),
    TutorialStep(
        "say",
        lazy("Place “{say}” below it"),
        lazy("You'll find it under Speech, on the left."),
        block_suffix=SAY,
    ),
    TutorialStep(
        "run",
        lazy("Press Run and listen"),
        lazy("The button is green, at the top left."),
        button_command="run.run",
    ),
    TutorialStep(
        "turn",
        lazy("Place “{turn}” below “{say}”"),
        lazy("You'll find it under Movement, on the left."),
        block_suffix=TURN,
    ),
    TutorialStep(
        "stop",
        lazy("Press Run, then Stop while the robot turns"),
        lazy("The Stop button is red, at the top right. F12 does the same."),
        button_command="run.run",
    ),
)


@dataclass(frozen=True)
class TutorialBlocks:
    """Blocks of the tutorial that a behaviour contains, as returned by `find_tutorial_blocks`.

    Attributes:
        has_start_block: True if there is a "when started" block.
        say_ids: Ids of the "say" blocks below "when started".
        has_turn: True if there is a "turn" block below "when started".
        detached_suffixes: Type suffixes of blocks that occur only in scripts without "when started".
    """

    has_start_block: bool = False
    say_ids: frozenset[str] = frozenset()
    has_turn: bool = False
    detached_suffixes: frozenset[str] = frozenset()


@dataclass(frozen=True)
class TutorialState:
    """Current state of the behaviour and its run.

    Attributes:
        can_speak: True if a robot that can speak is connected.
        blocks: Blocks of the tutorial that the behaviour contains.
        executed_ids: Ids of the blocks that have run.
        was_stopped: True after the run was stopped.
    """

    can_speak: bool = False
    blocks: TutorialBlocks = field(default_factory=TutorialBlocks)
    executed_ids: Collection[str] = ()
    was_stopped: bool = False


def find_tutorial_blocks(
    workspace: Mapping[str, object], ignored_ids: Collection[str] = ()
) -> TutorialBlocks:
    """Return the blocks of the tutorial that a workspace contains.

    Args:
        workspace: Workspace of the behaviour.
        ignored_ids: Ids of blocks to ignore because they belong to an example.
    """
    started_scripts: list[Script] = []
    detached_scripts: list[Script] = []
    has_start_block = False
    for top in _top_blocks(workspace):
        script = tuple((kind, id) for kind, id in _iter_blocks(top) if id not in ignored_ids)
        (started_scripts if top.get("type") == START_BLOCK else detached_scripts).append(script)
        has_start_block |= top.get("type") == START_BLOCK and top.get("id") not in ignored_ids
    attached_suffixes = {suffix for suffix in (SAY, TURN) if _contains_type(started_scripts, suffix)}
    return TutorialBlocks(
        has_start_block,
        frozenset(id for script in started_scripts for kind, id in script if kind.endswith(SAY)),
        TURN in attached_suffixes,
        frozenset(
            suffix
            for suffix in (SAY, TURN)
            if suffix not in attached_suffixes and _contains_type(detached_scripts, suffix)
        ),
    )


def _contains_type(scripts: Sequence[Script], suffix: str) -> bool:
    return any(kind.endswith(suffix) for script in scripts for kind, _id in script)


def completed_steps(state: TutorialState, completed: Collection[str]) -> frozenset[str]:
    """Return the ids of the completed steps.

    The last step, Stop, counts only after a run with a turn, so that it can't be completed by chance.

    Args:
        state: Current state of the behaviour and its run.
        completed: Ids of steps completed before, which stay completed.
    """
    step_ids = set(completed)
    if state.can_speak:
        step_ids.add("robot")
    if state.blocks.has_start_block:
        step_ids.add("start")
    if state.blocks.say_ids:
        step_ids.add("say")
    if state.blocks.say_ids & set(state.executed_ids):
        step_ids.add("run")
    if state.blocks.has_turn:
        step_ids.add("turn")
    if state.was_stopped and state.blocks.has_turn and {"run", "turn"} <= step_ids:
        step_ids.add("stop")
    return frozenset(step_ids)


def _top_blocks(workspace: Mapping[str, object]) -> list[Mapping[str, object]]:
    blocks = workspace.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, Mapping) else None
    return [top for top in tops if isinstance(top, Mapping)] if isinstance(tops, list) else []


def _iter_blocks(block: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    # Iterative, because deeply nested blocks would exceed the recursion limit.
    pending_blocks: list[object] = [block]
    while pending_blocks:
        current = pending_blocks.pop()
        if not isinstance(current, Mapping):
            continue
        yield str(current.get("type", "")), str(current.get("id", ""))
        inputs = current.get("inputs")
        input_links = inputs.values() if isinstance(inputs, Mapping) else ()
        pending_blocks += [
            link.get("block") for link in (*input_links, current.get("next")) if isinstance(link, Mapping)
        ]
