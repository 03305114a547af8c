"""Events: what starts a script."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import TopicField, ValueInput

CATEGORY = Category(
    name="events",
    title="Events",
    style="events",
    icon="zap",
    order=10,
    blocks=(
        Block(
            type="events_started",
            text="when started",
            shape="hat",
            style="events",
            icon="flag",
            tooltip="The blocks below run when the behaviour starts. A behaviour may have several of these: "
            "they run side by side.",
            python="on_start",
        ),
        Block(
            type="events_message",
            text="when a message arrives on %TOPIC",
            shape="hat",
            style="events",
            icon="radio",
            tooltip="The blocks below run for each message on this topic. “message” gives what it says.",
            python="on_message(%TOPIC)",
            arguments=(TopicField("TOPIC"),),
            parameters=("message",),
        ),
        Block(
            type="events_becomes_true",
            text="when %CONDITION becomes true",
            shape="hat",
            style="events",
            icon="activity",
            tooltip="The blocks below run each time this was not so and now is.",
            python="on_true(lambda: %CONDITION)",
            arguments=(ValueInput("CONDITION", "Boolean"),),
        ),
    ),
)
