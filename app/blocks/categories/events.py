"""Category Events: blocks that start scripts, and broadcasts."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import BroadcastField, TopicField, ValueInput

_NAME = BroadcastField("NAME", "start quiz")

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
            tooltip="The blocks below run when the behaviour starts. A behaviour can have several of "
            "these blocks; their scripts run at the same time.",
            example="For example: when started, Pepper says “Hello”.",
            python="on_start",
            search_words="begin, start, run, go, green flag, flag, play, launch, on start, setup, main",
        ),
        Block(
            type="events_message",
            text="when a message arrives on %TOPIC",
            shape="hat",
            style="events",
            icon="radio",
            tooltip="The blocks below run for each message on this topic. “message” contains its value.",
            example="For example: when a message arrives on /faces, Pepper says “Hello”.",
            python="on_message(%TOPIC)",
            arguments=(TopicField("TOPIC"),),
            parameters=("message",),
            search_words="topic, subscribe, listen, receive, data, incoming, on message",
        ),
        Block(
            type="events_becomes_true",
            text="when %CONDITION becomes true",
            shape="hat",
            style="events",
            icon="activity",
            tooltip="The blocks below run each time the condition becomes true.",
            example="For example: when “battery is below 20” becomes true, Pepper asks to be charged.",
            python="on_true(lambda: %CONDITION)",
            arguments=(ValueInput("CONDITION", "Boolean"),),
            search_words="condition, whenever, event, trigger, as soon as, watch, sensor, above, below, "
            "happens",
        ),
        Block(
            type="events_received",
            text="when I receive %NAME",
            shape="hat",
            style="events",
            icon="inbox",
            tooltip="The blocks below run when a block of this behaviour broadcasts this message.",
            help="Several scripts can receive the same message. A script that is still running restarts.",
            example="For example: when I receive “start quiz”, ask the first question.",
            python="on_broadcast(%NAME)",
            arguments=(_NAME,),
            search_words="broadcast, message, signal, event, on message, trigger, get",
        ),
        Block(
            type="events_broadcast",
            text="broadcast %NAME",
            shape="statement",
            style="events",
            icon="megaphone",
            tooltip="Starts the scripts that receive this message, and continues immediately.",
            help="Only scripts of this behaviour receive it. To reach other programs and robots, use "
            "“publish” in Messages.",
            example="For example: when the head is touched, broadcast “start quiz”.",
            python="broadcast(%NAME)",
            arguments=(_NAME,),
            search_words="send, message, signal, event, tell, emit, shout, trigger, start other scripts",
        ),
        Block(
            type="events_broadcast_wait",
            text="broadcast %NAME and wait",
            shape="statement",
            style="events",
            icon="megaphone",
            tooltip="Starts the scripts that receive this message, and waits until they have finished.",
            example="For example: broadcast “dance” and wait until all have danced, then say “Bravo”.",
            python="broadcast_and_wait(%NAME)",
            arguments=(_NAME,),
            search_words="send, message, signal, event, call, until done, trigger",
        ),
    ),
)
