"""List of problems, and the problems that concern several pages."""

from __future__ import annotations

from collections.abc import Iterable

from app.blocks.model.block import Block
from app.blocks.model.program import Problem, Severity
from app.blocks.model.workspace import PlacedBlock
from app.intents import AddReceiver, AddStartBlock, Intent, SetAtStart
from nep.i18n import _, pgettext

_SEVERITY_ORDER: dict[Severity, int] = {"error": 0, "warning": 1, "info": 2}
_START_BLOCK = "events_started"


class ProblemList:
    """List of problems; duplicate messages of a block are dropped."""

    def __init__(self) -> None:
        self._problems: dict[tuple[str | None, str], Problem] = {}

    def problems(self) -> tuple[Problem, ...]:
        """Return all problems, the most severe first."""
        return tuple(sorted(self._problems.values(), key=lambda problem: _SEVERITY_ORDER[problem.severity]))

    def unsorted_problems(self) -> tuple[Problem, ...]:
        """Return all problems in the order in which they were added."""
        return tuple(self._problems.values())

    def extend(self, problems: Iterable[Problem]) -> None:
        """Add problems."""
        for problem in problems:
            self._problems.setdefault((problem.block_id, problem.message), problem)

    def add(
        self,
        severity: Severity,
        placed_block: PlacedBlock | None,
        block: Block | None,
        subject: str,
        message: str,
        *,
        fix: str | None = None,
        fix_action: Intent | None = None,
        style: str | None = None,
    ) -> None:
        """Add a problem.

        Args:
            placed_block: Block with the problem; None for a problem of the whole behaviour.
            block: Description of the block; None if its type is unknown.
            subject: Part of ``message`` that is shown in bold.
            style: Name of the style that defines the colour; default: the style of ``block``.
        """
        problem = Problem(
            severity=severity,
            block_id=None if placed_block is None else placed_block.id,
            category=block.style if block is not None else style,
            subject=subject,
            message=message,
            fix=fix,
            fix_action=fix_action,
            icon=block.icon if block is not None else "circle-help",
        )
        self.extend((problem,))

    def add_no_start(self) -> None:
        """Add the problem that there are blocks but no script that can start."""
        subject = pgettext("block", "when started")
        self.add(
            "warning", None, None, subject,
            _("No event block starts these blocks, so they don't run. Put “{start}” above "
              "them.").format(start=subject),
            fix=_("Add “when started”"), fix_action=AddStartBlock(_START_BLOCK),
        )  # fmt: skip

    def add_never_set(
        self, placed_block: PlacedBlock, block: Block, id: str, name: str, *, is_list: bool
    ) -> None:
        """Add the problem that a variable is read but never set, so that its value remains 0.

        Args:
            placed_block: First block that reads the variable.
            block: Description of the block.
            id: Id of the variable.
            name: Name of the variable.
            is_list: True if the variable is used as a list.
        """
        subject = f"“{name}”"
        self.add(
            "warning", placed_block, block, subject, _("{name} is used but never set.").format(name=subject),
            fix=_("Set it to an empty list at the start") if is_list else _("Set it to 0 at the start"),
            fix_action=SetAtStart(id, is_list),
        )  # fmt: skip

    def add_never_received(self, placed_block: PlacedBlock, block: Block, name: str) -> None:
        """Add the problem that no script receives a broadcast."""
        subject = f"“{name}”"
        self.add(
            "warning", placed_block, block, subject, _("Nothing receives {name}.").format(name=subject),
            fix=_("Add “when I receive”"), fix_action=AddReceiver(name),
        )  # fmt: skip

    def add_never_sent(self, placed_block: PlacedBlock, block: Block, name: str) -> None:
        """Add the problem that a script waits for a broadcast which is never sent."""
        subject = f"“{name}”"
        message = _("Nothing broadcasts {name}, so this script doesn't run.").format(name=subject)
        self.add("info", placed_block, block, subject, message)
