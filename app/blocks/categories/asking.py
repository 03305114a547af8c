"""Category Ask: questions to the user of Studio."""

from __future__ import annotations

from app.blocks.model.block import Block
from app.blocks.model.category import Category
from app.blocks.model.fields import ValueInput
from app.blocks.model.mutators import ListInput

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
            type="asking_choices",
            text="ask %QUESTION with choices %CHOICES",
            shape="statement",
            style="values",
            icon="list-checks",
            tooltip="Shows a question in Studio with one large button for each choice, and waits for one.",
            help="“answer” is what was chosen. The arrows and Enter choose, and so do the keys 1 to 9; Esc "
            "answers nothing. The two buttons add and take away a choice; any other list fits in there, too. "
            "A question has room for 12 choices.",
            python="ask_with_choices(%QUESTION, %CHOICES)",
            arguments=(
                ValueInput("QUESTION", None, "Do you want to play?"),
                ListInput("CHOICES", texts=("yes", "no")),
            ),
            words="quiz!, menu!, choose, choice, question, buttons, options, select, pick, yes no, form",
        ),
        Block(
            type="asking_answer",
            text="answer",
            shape="value",
            style="values",
            icon="message-circle-reply",
            tooltip="What was answered to the last question: what was typed or chosen.",
            help="What is typed as a number can be counted with. Before the first question it is empty.",
            python="answer()",
            fails=False,
            words="input, reply, response, typed, user",
        ),
    ),
)
