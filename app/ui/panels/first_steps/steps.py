"""Definition of the six first steps, and detection of completed ones."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from nep.i18n import lazy

START = "events_started"
SAY, TURN = "_do_say", "_do_turn"
Script = tuple[tuple[str, str], ...]
"""Type and id of each block of a script."""


@dataclass(frozen=True)
class Lesson:
    """Step of the tutorial.

    Attributes:
        text: Sentence with ``{names}`` of blocks.
        hint: Where to find the block or button.
        takes: Suffix of the type of the block to drag.
        button: Command of the button to press.
    """

    id: str
    text: str
    hint: str
    takes: str = ""
    button: str = ""


STEPS: tuple[Lesson, ...] = (
    Lesson("robot", lazy("Use the virtual robot"), lazy("It comes with Studio."), button="robots.virtual"),
    Lesson(
        "start",
        lazy("Drag “{start}” onto the page"),
        lazy("You'll find it under Events, on the left."),
        takes=START,
    ),
    Lesson(
        "say", lazy("Place “{say}” below it"), lazy("You'll find it under Speech, on the left."), takes=SAY
    ),
    Lesson(
        "run", lazy("Press Run and listen"), lazy("The button is green, at the top left."), button="run.run"
    ),
    Lesson(
        "turn",
        lazy("Place “{turn}” below “{say}”"),
        lazy("You'll find it under Movement, on the left."),
        takes=TURN,
    ),
    Lesson(
        "stop",
        lazy("Press Run, then Stop while the robot turns"),
        lazy("The Stop button is red, at the top right. F12 does the same."),
        button="run.run",
    ),
)


@dataclass(frozen=True)
class Built:
    """Result of `built_in`: ids of "say" blocks below "when started", and True if there is a "turn" block.

    `loose` has the type suffixes of blocks that occur only in scripts without an event.
    """

    started: bool = False
    says: frozenset[str] = frozenset()
    turns: bool = False
    loose: frozenset[str] = frozenset()


@dataclass(frozen=True)
class Now:
    """Current state of blocks and run.

    `ran` has the ids of blocks that have run; `stopped` is True after Stop.
    """

    can_speak: bool = False
    built: Built = field(default_factory=Built)
    ran: Collection[str] = ()
    stopped: bool = False


def built_in(workspace: Mapping[str, object], others: Collection[str] = ()) -> Built:
    """Return the tutorial's blocks that a workspace contains.

    Args:
        workspace: Program of the behaviour.
        others: Ids of blocks to ignore because they came with an example.
    """
    started: list[Script] = []
    loose: list[Script] = []
    is_started = False
    for top in _tops(workspace):
        own = tuple((kind, id) for kind, id in _inside(top) if id not in others)
        (started if top.get("type") == START else loose).append(own)
        is_started |= top.get("type") == START and top.get("id") not in others
    below = {end for end in (SAY, TURN) if _has(started, end)}
    return Built(
        is_started,
        frozenset(id for script in started for kind, id in script if kind.endswith(SAY)),
        TURN in below,
        frozenset(end for end in (SAY, TURN) if end not in below and _has(loose, end)),
    )


def _has(scripts: Sequence[Script], end: str) -> bool:
    return any(kind.endswith(end) for script in scripts for kind, _id in script)


def shown_by(now: Now, done: Collection[str]) -> frozenset[str]:
    """Return the ids of completed steps; steps in `done` stay completed.

    Stop counts only after a run with a turn, so that the step can't be completed by chance.
    """
    found = set(done)
    if now.can_speak:
        found.add("robot")
    if now.built.started:
        found.add("start")
    if now.built.says:
        found.add("say")
    if now.built.says & set(now.ran):
        found.add("run")
    if now.built.turns:
        found.add("turn")
    if now.stopped and now.built.turns and {"run", "turn"} <= found:
        found.add("stop")
    return frozenset(found)


def _tops(workspace: Mapping[str, object]) -> list[Mapping[str, object]]:
    blocks = workspace.get("blocks")
    tops = blocks.get("blocks") if isinstance(blocks, Mapping) else None
    return [top for top in tops if isinstance(top, Mapping)] if isinstance(tops, list) else []


def _inside(block: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    # Iterative, because deeply nested blocks would exceed the recursion limit.
    waiting: list[object] = [block]
    while waiting:
        each = waiting.pop()
        if not isinstance(each, Mapping):
            continue
        yield str(each.get("type", "")), str(each.get("id", ""))
        inputs = each.get("inputs")
        held = inputs.values() if isinstance(inputs, Mapping) else ()
        waiting += [link.get("block") for link in (*held, each.get("next")) if isinstance(link, Mapping)]
