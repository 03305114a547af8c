"""Category Messages: publishing on topics and reading messages."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import PathField, TextField, TopicField, ValueInput

CATEGORY = Category(
    name="messages",
    title="Messages",
    style="messages",
    icon="radio",
    order=60,
    blocks=(
        Block(
            type="messages_publish",
            text="publish %VALUE on %TOPIC",
            shape="statement",
            style="messages",
            icon="megaphone",
            tooltip="Sends a value to all programs that subscribe to this topic.",
            example="For example: publish “started” on /blackboard.",
            python="publish(%TOPIC, %VALUE)",
            arguments=(ValueInput("VALUE", None, "hello"), TopicField("TOPIC")),
            is_publisher=True,
            search_words="send, topic, tell, transmit, post, message, network, share",
        ),
        Block(
            type="messages_publish_field",
            text="publish %FIELD : %VALUE on %TOPIC",
            shape="statement",
            style="messages",
            icon="megaphone",
            tooltip="Sends a message with one named field, such as {“name”: “Ada”}.",
            example="For example: publish name: “Ada” on /faces.",
            python="publish(%TOPIC, {%FIELD: %VALUE})",
            arguments=(TextField("FIELD", "name"), ValueInput("VALUE", None, "Ada"), TopicField("TOPIC")),
            is_publisher=True,
            search_words="send, topic, json, key, named, field, message, network",
        ),
        Block(
            type="messages_write",
            text="write %VALUE to the console",
            shape="statement",
            style="messages",
            icon="terminal",
            tooltip="Shows a value as a line in the console.",
            example="For example: write the distance to the console.",
            python="write(%VALUE)",
            arguments=(ValueInput("VALUE", None, "Hello"),),
            search_words="print, say, log, show, display, console, output, debug, text, terminal, screen",
        ),
        Block(
            type="messages_newest",
            text="newest %FIELD of %TOPIC",
            shape="value",
            style="messages",
            icon="radio",
            tooltip="A field of the newest message on this topic. It has no value until the first "
            "message arrives.",
            example="For example: say newest name of /faces.",
            python="newest(%TOPIC, %FIELD)",
            arguments=(PathField("FIELD", "name"), TopicField("TOPIC", "/faces")),
            search_words="read, topic, latest, last, get, receive, subscribe, value, current",
        ),
        Block(
            type="messages_message",
            text="message",
            shape="value",
            style="messages",
            icon="mail",
            tooltip="The content of the message that started this script.",
            example="For example: write “message” to the console.",
            python="message",
            can_fail=False,
            needs_message=True,
            search_words="received, data, content, payload, what arrived",
        ),
        Block(
            type="messages_field",
            text="%FIELD of the message",
            shape="value",
            style="messages",
            icon="mail",
            tooltip="One field of the message that started this script.",
            example="For example: say “name” of the message.",
            python="part(message, %FIELD)",
            arguments=(PathField("FIELD", "name", topic_field=""),),
            needs_message=True,
            search_words="received, part, data, json, key, value",
        ),
    ),
)
