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
        button: Command of the button to press, or "".
    """

    id: str
    text: str
    hint: str
    block_suffix: str = ""
    button: str = ""


STEPS: tuple[TutorialStep, ...] = (
    TutorialStep(
        "robot", lazy("Use the virtual robot"), lazy("It comes with Studio."), button="robots.virtual"
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
        "run", lazy("Press Run and listen"), lazy("The button is green, at the top left."), button="run.run"
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
        button="run.run",
    ),
)


@dataclass(frozen=True)
class TutorialBlocks:
    """Blocks of the tutorial that a behaviour contains, as returned by `find_tutorial_blocks`.

    Attributes:
        started: True if there is a "when started" block.
        say_ids: Ids of the "say" blocks below "when started".
        has_turn: True if there is a "turn" block below "when started".
        detached_suffixes: Type suffixes of blocks that occur only in scripts without "when started".
    """

    started: bool = False
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


def find_tutorial_blocks(workspace: Mapping[str, object], others: Collection[str] = ()) -> TutorialBlocks:
    """Return the blocks of the tutorial that a workspace contains.

    Args:
        workspace: Workspace of the behaviour.
        others: Ids of blocks to ignore because they belong to an example.
    """
    started: list[Script] = []
    loose: list[Script] = []
    is_started = False
    for top in _top_blocks(workspace):
        own_blocks = tuple((kind, id) for kind, id in _iter_blocks(top) if id not in others)
        (started if top.get("type") == START_BLOCK else loose).append(own_blocks)
        is_started |= top.get("type") == START_BLOCK and top.get("id") not in others
    below = {end for end in (SAY, TURN) if _contains_type(started, end)}
    return TutorialBlocks(
        is_started,
        frozenset(id for script in started for kind, id in script if kind.endswith(SAY)),
        TURN in below,
        frozenset(end for end in (SAY, TURN) if end not in below and _contains_type(loose, end)),
    )


def _contains_type(scripts: Sequence[Script], end: str) -> bool:
    return any(kind.endswith(end) for script in scripts for kind, _id in script)


def completed_steps(now: TutorialState, completed: Collection[str]) -> frozenset[str]:
    """Return the ids of the completed steps.

    The last step, Stop, counts only after a run with a turn, so that it can't be completed by chance.

    Args:
        now: Current state of the behaviour and its run.
        completed: Ids of steps completed before, which stay completed.
    """
    step_ids = set(completed)
    if now.can_speak:
        step_ids.add("robot")
    if now.blocks.started:
        step_ids.add("start")
    if now.blocks.say_ids:
        step_ids.add("say")
    if now.blocks.say_ids & set(now.executed_ids):
        step_ids.add("run")
    if now.blocks.has_turn:
        step_ids.add("turn")
    if now.was_stopped and now.blocks.has_turn and {"run", "turn"} <= step_ids:
        step_ids.add("stop")
    return frozenset(step_ids)


def _top_blocks(workspace: Mapping[str, object]) -> list[Mapping[str, object]]:
    blocks = workspace.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, Mapping) else None
    return [top for top in tops if isinstance(top, Mapping)] if isinstance(tops, list) else []


def _iter_blocks(block: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    # Iterative, because deeply nested blocks would exceed the recursion limit.
    waiting: list[object] = [block]
    while waiting:
        each = waiting.pop()
        if not isinstance(each, Mapping):
            continue
        yield str(each.get("type", "")), str(each.get("id", ""))
        inputs = each.get("inputs")
        input_links = inputs.values() if isinstance(inputs, Mapping) else ()
        waiting += [
            link.get("block") for link in (*input_links, each.get("next")) if isinstance(link, Mapping)
        ]
