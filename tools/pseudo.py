"""Pseudo-language that reveals untranslated texts, and the texts of blocks and examples.

Doesn't use Babel.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
MARKUP = re.compile(r"\[(?:bold|dim|blue|red|green|yellow|cyan)[a-z ]*\]|\[/\]|</?[a-z]+>|`[^`]*`")
_KEPT = re.compile(rf"\{{[^{{}}]*\}}|%[A-Za-z_]\w*|%(?:\(\w+\)[sdr]|\d)|{MARKUP.pattern}")
_ACCENTS = str.maketrans(
    "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ",
    "áƀçđéƒğĥíĵķłḿñóþǫřšťúṽŵẋýžÁƁÇĐÉƑĞĤÍĴĶŁḾÑÓÞǪŘŠŤÚṼŴẊÝŽ",
)


def pseudo(english: str) -> str:
    """Convert `Run` to `[Ŕúñ ~~]`: a third longer, with brackets and accents; placeholders stay unchanged."""
    pieces, offset = [], 0
    for match in _KEPT.finditer(english):
        pieces += [english[offset : match.start()].translate(_ACCENTS), match.group()]
        offset = match.end()
    pieces.append(english[offset:].translate(_ACCENTS))
    text = "".join(pieces)
    # Before a placeholder or command, "[" would become markup after formatting.
    begin = "[" if text[:1] and text[0] not in "{%[`<" else "[~"
    return f"{begin}{text} {'~' * max(1, math.ceil(0.35 * len(english)))}]"


def sentences_of_blocks() -> Iterator[tuple[str | None, str, str]]:
    """Yield (context, English text, file) for the block definitions, whose texts are not passed to `_`."""
    # imported here because builds compile catalogues with only the build requirements installed
    from app.blocks.categories.robot import GROUPS  # noqa: PLC0415
    from app.blocks.toolbox.catalogue import english_categories, is_translatable  # noqa: PLC0415
    from app.blocks.toolbox.help import english_slot_name  # noqa: PLC0415

    file_by_text: dict[tuple[str | None, str], str] = {}
    for category in english_categories():
        file = f"app/blocks/categories/{category.name}.py"

        def say(context: str | None, english: str, file: str = file) -> str:
            if is_translatable(english):
                file_by_text.setdefault((context, english), file)
            return english

        category.translated(say)
        for block in category.blocks:
            for argument in block.arguments:
                say("gap", english_slot_name(argument))
    for title in GROUPS:
        file_by_text.setdefault(("category", title), "app/blocks/categories/robot.py")
    for (context, english), file in file_by_text.items():
        yield context, english, file


def sentences_of_examples() -> Iterator[tuple[str, str, str]]:
    """Yield (context, English text, file) for the texts that are translated when an example is opened."""
    from app.core.projects.examples import translated  # noqa: PLC0415 - as above
    from app.core.projects.file_format import read_file  # noqa: PLC0415

    file_by_text: dict[tuple[str, str], str] = {}
    for path in sorted((ROOT / "resources" / "examples").glob("*.nepb")):
        file = path.relative_to(ROOT).as_posix()

        def say(context: str, english: str, file: str = file) -> str:
            file_by_text.setdefault((context, english), file)
            return english

        translated(read_file(path), say)
    for (context, english), file in file_by_text.items():
        yield context, english, file
