"""Ask: questions to the person in front of Studio."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ValueInput

CATEGORY = Category(
    name="asking",
    title="Ask",
    style="values",
    icon="message-circle-question-mark",
    order=33,
    within="texts",
    blocks=(
        Block(
            type="asking_ask",
            text="ask %QUESTION and wait",
            shape="statement",
            style="values",
            icon="message-circle-question-mark",
            tooltip="Shows a question in Studio and waits until somebody answers it.",
            help="“answer” is what was typed. Enter answers, Esc answers nothing. Let a robot say the "
            "question first, if it shall be heard. The other scripts go on; what they ask comes afterwards.",
            python="ask(%QUESTION)",
            arguments=(ValueInput("QUESTION", None, "What is your name?"),),
            words="input, prompt, question, type, person, read, keyboard, user, form",
        ),
        Block(
            type="asking_answer",
            text="answer",
            shape="value",
            style="values",
            icon="message-circle-reply",
            tooltip="What was answered to the last question.",
            help="What is typed as a number can be counted with. Before the first question it is empty.",
            python="answer()",
            fails=False,
            words="input, reply, response, typed, user",
        ),
    ),
)
