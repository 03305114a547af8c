"""What a program needs before its first block: robots, their sensors and events, topics."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.fields import ChoiceField, Field, TopicField
from app.blocks.model.workspace import Placed


class Uses:
    """Collects what blocks name, each thing once and in the order of the blocks (dicts keep it)."""

    def __init__(self) -> None:
        self.robots: dict[str, None] = {}
        self.sensors: dict[tuple[str, str], None] = {}
        self.events: dict[tuple[str, str], None] = {}
        self.publishes: dict[str, None] = {}
        self.listens: dict[str, None] = {}
        self.moves: dict[str, None] = {}

    def remember(self, placed: Placed, block: Block) -> None:
        """Add what this block names; its fields are sound."""
        use = block.robot
        if use is not None:
            robot = placed.field_id("ROBOT") or _first_robot(block)
            self.robots[robot] = None
            name = use.name or str(saved_value(block, placed, "SENSOR"))
            if use.kind == "sensor":
                self.sensors[robot, name] = None
            elif use.kind == "event":
                self.events[robot, name] = None
        for argument in block.arguments:
            if isinstance(argument, TopicField):
                topics = self.publishes if block.publishes else self.listens
                topics[str(saved_value(block, placed, argument.name))] = None


def saved_value(block: Block, placed: Placed, name: str) -> object:
    """What a file says in a field of a block; FieldError if the block can't use it, None for no field."""
    argument = block.argument(name)
    return argument.read(placed.fields.get(name)) if isinstance(argument, Field) else None


def _first_robot(block: Block) -> str:
    field = block.argument("ROBOT")
    return str(field.read(None)) if isinstance(field, ChoiceField) else ""
