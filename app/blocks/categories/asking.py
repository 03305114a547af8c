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
    parent="texts",
    blocks=(
        Block(
            type="asking_ask",
            text="ask %QUESTION and wait",
            shape="statement",
            style="values",
            icon="message-circle-question-mark",
            tooltip="Shows a question in Studio and waits until somebody answers it.",
            help="The typed text is stored in “answer”. Press Enter to answer; Esc leaves the answer "
            "empty. The question isn't spoken: use “say” of a robot for that. The other scripts continue; "
            "their questions are asked afterwards.",
            example="For example: ask “What is your name?” and wait, then say join “Hello ” and answer.",
            python="ask(%QUESTION)",
            arguments=(ValueInput("QUESTION", None, "What is your name?"),),
            search_words="input, prompt, question, type, person, read, keyboard, user, form",
        ),
        Block(
            type="asking_choices",
            text="ask %QUESTION with choices %CHOICES",
            shape="statement",
            style="values",
            icon="list-checks",
            tooltip="Shows a question in Studio with a large button for each choice, and waits for an "
            "answer.",
            help="The choice is stored in “answer”. Choose with the arrow keys and Enter, or with the "
            "keys 1 to 9; Esc leaves the answer empty. The two buttons add and remove a choice; you can also "
            "insert another list. A question can have up to 12 choices.",
            example="For example: ask “Which animal is this?” with choices “cat”, “dog” and “cow”.",
            python="ask_with_choices(%QUESTION, %CHOICES)",
            arguments=(
                ValueInput("QUESTION", None, "Do you want to play?"),
                ListInput("CHOICES", texts=("yes", "no")),
            ),
            search_words="quiz!, menu!, choose, choice, question, buttons, options, select, pick, yes no, "
            "form",
        ),
        Block(
            type="asking_answer",
            text="answer",
            shape="value",
            style="values",
            icon="message-circle-reply",
            tooltip="The answer to the last question, as typed or chosen.",
            help="If a number was typed, you can calculate with it. Before the first question, the "
            "answer is empty.",
            example="For example: if “answer is 7”, say “Right!”.",
            python="answer()",
            can_fail=False,
            search_words="input, reply, response, typed, user",
        ),
    ),
)
