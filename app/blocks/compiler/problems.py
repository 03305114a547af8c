"""Problems of the blocks of a page, as messages shown before Run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from app.blocks.compiler.conflicts import Conflict
from app.blocks.compiler.foreign import EQUIVALENT_BLOCKS
from app.blocks.compiler.problem_list import ProblemList
from app.blocks.model.block import Block
from app.blocks.model.block_text import block_text, label, label_of_unknown
from app.blocks.model.fields import Argument, Field, FieldError, TextField, ValueInput, VariableField
from app.blocks.model.workspace import PlacedBlock, Workspace
from app.blocks.toolbox.catalogue import Catalogue
from app.intents import AddTimeLimit, ConnectRobot, DefineFunction, JoinScripts, PointAtBlock, RenameVariable
from app.robots.description.description import Action
from nep.i18n import _, format_list, lazy, pgettext

_SLOT_TYPE_NAMES = {
    "Number": lazy("a number"),
    "String": lazy("a text"),
    "Boolean": lazy("a condition"),
    "List": lazy("a list"),
    None: lazy("a value"),
}
_PEOPLE_KEYWORDS = frozenset({"face", "faces", "person", "people"})
_LITERAL_FIELDS = {"values_number": "NUMBER", "values_text": "TEXT"}
_RESOURCE_NAMES = {
    "head": lazy("the head"),
    "arms": lazy("the arms"),
    "speech": lazy("the voice"),
    "face": lazy("the face"),
    "lights": lazy("the lights"),
    "light": lazy("the light"),
}
"""Display names of the resources of Studio's own robots; resources of other robots are shown by name."""


class ProblemCollector(ProblemList):
    """Collector of the problems that the compiler finds on one page."""

    def __init__(self, catalogue: Catalogue, workspace: Workspace) -> None:
        super().__init__()
        self._catalogue = catalogue
        self._workspace = workspace

    def label(self, placed_block: PlacedBlock, block: Block | None) -> str:
        """Return the label of a block for use in messages."""
        return label_of_unknown(placed_block) if block is None else label(placed_block, block)

    def report_unattached(self, placed_block: PlacedBlock, block: Block) -> None:
        """Report a block that is neither below a start block nor in a slot of another block."""
        name = self.label(placed_block, block)
        if block.shape in ("value", "boolean"):
            template = _("{block} isn't used. Drag it into an empty slot of another block.")
            self.add("info", placed_block, block, name, template.format(block=name))
            return
        message = _("{block} doesn't run. Put it below “{start}”.")
        start = pgettext("block", "when started")
        self.add("info", placed_block, block, name, message.format(block=name, start=start))

    def report_misplaced(self, placed_block: PlacedBlock, block: Block) -> None:
        """Report a block at an invalid position, which the editor prevents but a file may contain."""
        name = self.label(placed_block, block)
        message = _("{block} can't be used here. It stays in the file but is skipped.")
        self.add("warning", placed_block, block, name, message.format(block=name))

    def report_too_deep(self, placed_block: PlacedBlock) -> None:
        """Report a block that is nested too deeply for Python."""
        block = self._catalogue.blocks.get(placed_block.type)
        name = self.label(placed_block, block)
        self.add(
            "error", placed_block, block, name,
            _(

            "{block} is nested too deeply. Save intermediate results in variables, or move inner "
            "blocks to separate scripts."

            ).format(block=name),
        )  # fmt: skip

    def report_no_message(self, placed_block: PlacedBlock, block: Block) -> None:
        """Report a block that reads the received message but is not in a script started by a message."""
        name = self.label(placed_block, block)
        self.add(
            "warning", placed_block, block, name,
            _("{block} only works below “when a message arrives”.").format(block=name),
        )  # fmt: skip

    def report_unknown_input(self, placed_block: PlacedBlock, block: Block) -> None:
        """Report a function input that is used outside of its function, or that was removed."""
        name = block_text(placed_block, self._catalogue.blocks, self._workspace.variables)
        message = _(
            "“{name}” only works inside its own function. It stays in the file but is skipped."
        ).format(name=name)
        self.add("warning", placed_block, block, name, message)

    def report_undefined(self, placed_block: PlacedBlock, block: Block) -> None:
        """Report a call of an undefined function."""
        self.add(
            "error", placed_block, block, self.label(placed_block, block), block.undefined_message,
            fix=_("Define the function"), fix_action=DefineFunction(placed_block.id),
        )  # fmt: skip

    def report_conflict(self, conflict: Conflict) -> None:
        """Report two scripts that use the same resource of a robot, at the block of the second script."""
        placed_block, name = conflict.second.block, conflict.second.action.title
        resource = _RESOURCE_NAMES.get(conflict.resource)
        template = _("“{action}” and “{other}” both move {robot} at the same time: one replaces the other.")
        if resource is not None or conflict.resource != "base":
            template = _(
                "“{action}” and “{other}” both use {part} of {robot} at the same time: "
                "one replaces the other."
            )
        message = template.format(
            action=conflict.first.action.title, other=name, robot=conflict.second.robot,
            part=_("the {part}").format(part=conflict.resource) if resource is None else _(resource),
        )  # fmt: skip
        self.add(
            "warning", placed_block, self._catalogue.blocks.get(placed_block.type), name, message,
            fix=_("Run one after the other") if conflict.reordering else None,
            fix_action=JoinScripts(*conflict.reordering) if conflict.reordering else None,
        )  # fmt: skip

    def report_invalid_field(self, placed_block: PlacedBlock, block: Block, error: FieldError) -> None:
        """Report an invalid field value."""
        name = self.label(placed_block, block)
        message = _("{block} {what_is_wrong}. It stays in the file but is skipped.")
        self.add("error", placed_block, block, name, message.format(block=name, what_is_wrong=error))

    def report_unsupported(
        self, placed_block: PlacedBlock, block: Block | None, parent: PlacedBlock | None
    ) -> bool:
        """Report a block that can't run, and return True if it was reported.

        Such a block is unknown, or its robot is not connected or doesn't support it.

        Args:
            placed_block: Block in the workspace.
            block: Description of the block; None if the type is unknown.
            parent: Block that contains the block in a slot, and that is skipped too; None for a
                statement.
        """
        robot = placed_block.fields.get("ROBOT")
        name = self.label(placed_block, block)
        skipped_blocks = name
        if parent is not None:
            parent_label = self.label(parent, self._catalogue.blocks.get(parent.type))
            skipped_blocks = _("{outer_block} with {inner_block}").format(
                outer_block=parent_label, inner_block=name
            )
        if (
            isinstance(robot, str)
            and robot not in self._catalogue.connected
            and placed_block.type.startswith("robot_")
        ):
            message = _("{robot} isn't connected, so {block} will be skipped.")
            self.add(
                "warning", placed_block, block, name, message.format(robot=robot, block=skipped_blocks),
                fix=_("Show the robots"), fix_action=ConnectRobot(robot), style="robot",
            )  # fmt: skip
            return True
        if block is None:
            self._report_unknown(placed_block, name)
            return True
        if isinstance(robot, str) and block.robot is not None and not self._is_supported(robot, block):
            message = _("{robot} can't do this, so {block} will be skipped.")
            self.add("warning", placed_block, block, name, message.format(robot=robot, block=skipped_blocks))
            return True
        return False

    def _report_unknown(self, placed_block: PlacedBlock, name: str) -> None:
        equivalent = self._catalogue.blocks.get(EQUIVALENT_BLOCKS.get(placed_block.type, ""))
        prefixes = {each.partition("_")[0] for each in self._catalogue.blocks}
        if placed_block.type.startswith("robot_"):
            message = _(
                "This file uses “{block}”, which no connected robot supports. It stays in the file but is "
                "skipped."
            )
            self.add("warning", placed_block, None, name, message.format(block=name), style="robot")
        elif equivalent is not None:
            equivalent_label = label(PlacedBlock("", equivalent.type), equivalent)
            message = _(
                "“{block}” belongs to another program and can't run here. It stays in the file but is "
                "skipped. “{own_block}” does the same."
            )
            self.add(
                "warning", placed_block, None, name, message.format(block=name, own_block=equivalent_label),
                fix=_("Show “{block}”").format(block=equivalent_label),
                fix_action=PointAtBlock(equivalent.type),
            )  # fmt: skip
        elif placed_block.type.partition("_")[0] in prefixes:
            message = _(
                "“{block}” isn't known to this version of NEP Studio. It stays in the file but is skipped."
            )
            self.add("warning", placed_block, None, name, message.format(block=name))
        else:
            message = _(
                "“{block}” belongs to another program and can't run here. It stays in the file but is "
                "skipped."
            )
            self.add("warning", placed_block, None, name, message.format(block=name))

    def check_unknown(self) -> None:
        """Report unknown blocks that the compiler didn't reach because they are inside skipped blocks."""
        reported_ids = {id for id, _sentence in self._problems}
        for placed_block in self._enabled_blocks():
            if placed_block.type not in self._catalogue.blocks and placed_block.id not in reported_ids:
                self._report_unknown(placed_block, self.label(placed_block, None))

    def _enabled_blocks(self) -> Iterator[PlacedBlock]:
        pending = [
            placed_block for script in reversed(self._workspace.scripts) for placed_block in reversed(script)
        ]
        while pending:
            placed_block = pending.pop()
            if placed_block.is_enabled:
                yield placed_block
                inner = [each for chain in placed_block.inputs.values() for each in chain]
                pending += reversed(inner)

    def check_names(self) -> None:
        """Report used variables that have no name in the file."""
        reported_ids: set[str] = set()
        for placed_block in self._enabled_blocks() if self._workspace.nameless_variables else ():
            block = self._catalogue.blocks.get(placed_block.type)
            for argument in block.arguments if block is not None else ():
                id = _variable_id(argument, placed_block)
                if id not in self._workspace.nameless_variables or id in reported_ids:
                    continue
                reported_ids.add(id)
                name = self.label(placed_block, block)
                self.add(
                    "warning", placed_block, block, name,
                    _(
                        "The variable in “{block}” has no name in this file. Name it, or choose another "
                        "variable in the block."
                    ).format(block=name),
                    fix=_("Name the variable"), fix_action=RenameVariable(id),
                )  # fmt: skip

    def absent_blocks(self) -> tuple[str, ...]:
        """Return the ids of all blocks of disconnected robots, including blocks outside of scripts."""
        return tuple(
            placed_block.id
            for placed_block in self._workspace.all_blocks()
            if placed_block.type.startswith("robot_")
            and isinstance(placed_block.fields.get("ROBOT"), str)
            and placed_block.fields["ROBOT"] not in self._catalogue.connected
        )

    def _is_supported(self, name: str, block: Block) -> bool:
        use = block.robot
        robot = self._catalogue.connected[name]
        if use is None or not use.name:
            return True
        capability = (
            robot.action(use.name)
            if use.kind == "action"
            else robot.sensor(use.name)
            if use.kind == "sensor"
            else robot.event(use.name)
        )
        return capability is not None

    def report_empty_slot(self, placed_block: PlacedBlock, block: Block) -> str | None:
        """Report the first required slot that is empty and return the message; None if there is none."""
        for argument in block.arguments:
            if not isinstance(argument, ValueInput):
                continue
            inner = placed_block.inputs.get(argument.name, ())
            if (inner and inner[0].is_enabled) or not argument.is_present(placed_block.fields):
                continue
            name = self.label(placed_block, block)
            message = _("{block} needs {what}. Drag one into its slot.").format(
                block=name, what=_(_SLOT_TYPE_NAMES[argument.check])
            )
            self.add("error", placed_block, block, name, message)
            return message
        return None

    def report_hints(self, placed_block: PlacedBlock, block: Block) -> None:
        """Report a wait without time limit, and invalid values in the input of an action."""
        if block.type == "control_wait_until" and not _is_literal(placed_block, "CONDITION"):
            self.add(
                "info", placed_block, block, self.label(placed_block, block),
                self._wait_forever_message(placed_block, block),
                fix=_("Add a time limit"), fix_action=AddTimeLimit(placed_block.id),
            )  # fmt: skip
        robot = self._catalogue.connected.get(str(placed_block.fields.get("ROBOT")))
        action = robot.action(block.robot.name) if robot and block.robot else None
        if action is not None:
            self._check_input(placed_block, block, action)

    def report_motion(
        self, placed_block: PlacedBlock, block: Block, topic: str, robots: Sequence[str]
    ) -> None:
        """Report a block that moves robots by publishing on a topic.

        Args:
            placed_block: Block in the workspace.
            block: Description of the block.
            topic: Name of the topic.
            robots: Names of the moved robots; virtual robots are not reported.
        """
        real_robots = [name for name in robots if not self._catalogue.connected[name].virtual]
        if real_robots:
            robot_names, name = format_list(real_robots), self.label(placed_block, block)
            message = _(
                "{block} on {topic} moves {robots}. Studio asks for permission first; Stop ends the movement."
            )
            self.add(
                "info", placed_block, block, name, message.format(block=name, topic=topic, robots=robot_names)
            )

    def _wait_forever_message(self, placed_block: PlacedBlock, block: Block) -> str:
        name = self.label(placed_block, block)
        if _depends_on_people(placed_block.inputs["CONDITION"][0]):
            return _("{block} waits forever if no one appears.").format(block=name)
        return _("{block} waits forever if that never happens.").format(block=name)

    def _check_input(self, placed_block: PlacedBlock, block: Block, action: Action) -> None:
        literal_values: dict[str, object] = {}
        for argument_name, name in block.keywords.get("X_INPUT", ()):
            value = _literal_value(placed_block, block, argument_name)
            if value is not None:
                literal_values[name] = value
        # Skip problems that exist without these values: the missing ones are computed at run time.
        existing_problems = set(action.problems(action.complete({})))
        for problem in action.problems(action.complete(literal_values)):
            if problem not in existing_problems:
                name = self.label(placed_block, block)
                self.add("error", placed_block, block, name, f"{name}: {problem.message}.")


def _is_literal(placed_block: PlacedBlock, name: str) -> bool:
    inner = placed_block.inputs.get(name, ())
    return bool(inner) and inner[0].type == "values_boolean"


def _depends_on_people(condition: PlacedBlock) -> bool:
    # Uses the types of the blocks, because their texts are translated.
    return not _PEOPLE_KEYWORDS.isdisjoint(condition.type.split("_")) or any(
        _depends_on_people(inner) for chain in condition.inputs.values() for inner in chain
    )


def _variable_id(argument: Argument, placed_block: PlacedBlock) -> str:
    if not isinstance(argument, VariableField):
        return ""
    try:
        return str(argument.read(placed_block.fields.get(argument.name)))
    except FieldError:
        return ""


def _literal_value(placed_block: PlacedBlock, block: Block, name: str) -> object:
    # None for a value that is computed at run time.
    argument = block.argument(name)
    if isinstance(argument, Field):
        try:
            return argument.read(placed_block.fields.get(name))
        except FieldError:
            return None
    inner = placed_block.inputs.get(name, ())
    if not inner or inner[0].type not in _LITERAL_FIELDS:
        return None
    return _literal_block_value(inner[0])


def _literal_block_value(placed_block: PlacedBlock) -> object:
    name = _LITERAL_FIELDS[placed_block.type]
    saved = placed_block.fields.get(name)
    if name == "TEXT":
        return TextField(name).read(saved)
    return saved if isinstance(saved, (int, float)) and not isinstance(saved, bool) else None
