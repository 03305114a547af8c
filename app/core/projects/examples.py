"""Translation of examples into the current language.

Example files are in English; an example is translated when the user opens it. Identifiers that programs
exchange are not translated: topics, field names, message types, choices and robots.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache

from app import resources
from app.blocks.model.project import Page, Project
from app.blocks.model.workspace import saved_blocks
from app.blocks.model.workspace_json import WorkspaceJson
from app.core.projects.file_format import SUFFIX, read_file
from nep.i18n import translate

NAME, ABOUT, TEXT, LABEL, NOTE = (
    "name of an example",
    "about an example",
    "text in an example",
    "name in an example",
    "note of an example",
)
"""Translation contexts: the example's name, its one-line description, a text block, the name of a variable or
function, and the comment next to the blocks.
"""

TranslateText = Callable[[str, str], str]
"""Function that translates an English text, given its context and the text."""


def translated(example: Project, translate_text: TranslateText = translate) -> Project:
    """Return a translated copy of an example. Not for files of the user.

    Equal English texts get equal translations, so that comparisons between them still work.
    """
    names: dict[str, str] = {}

    def translate_label(english: str) -> str:
        # English where two names would be equal.
        if english not in names:
            translation = translate_text(LABEL, english)
            is_taken = translation.casefold() in map(str.casefold, names.values())
            names[english] = english if is_taken else translation
        return names[english]

    def translate_page(page: Page) -> Page:
        blocks = _translate_value(page.workspace.blocks, translate_text, translate_label)
        return page.with_workspace(WorkspaceJson.from_blocks(blocks)) if isinstance(blocks, Mapping) else page

    unknown_fields = dict(example.unknown_fields)
    if isinstance(about := unknown_fields.get("description"), str):
        unknown_fields["description"] = translate_text(ABOUT, about)
    return replace(
        example,
        name=translate_text(NAME, example.name),
        pages=tuple(map(translate_page, example.pages)),
        unknown_fields=unknown_fields,
    )


@lru_cache(maxsize=1)
def example_block_ids() -> frozenset[str]:
    """Return the ids of all blocks in Studio's examples. Blocks created by users have other ids."""
    return frozenset(
        str(block.get("id"))
        for path in sorted(resources.path("examples").glob(f"*{SUFFIX}"))
        for page in read_file(path).pages
        for block in saved_blocks(page.workspace.blocks)
    )


def _translate_value(
    value: object, translate_text: TranslateText, translate_label: Callable[[str], str]
) -> object:
    # A part of the blocks in Blockly's format.
    if isinstance(value, list):
        return [_translate_value(each, translate_text, translate_label) for each in value]
    if not isinstance(value, Mapping):
        return value
    result = {key: _translate_value(each, translate_text, translate_label) for key, each in value.items()}
    kind, fields = result.get("type"), result.get("fields")
    if kind == "values_text" and isinstance(fields, dict) and _has_letters(fields.get("TEXT")):
        fields["TEXT"] = translate_text(TEXT, str(fields["TEXT"]))
    if str(kind).startswith("functions_define") and isinstance(fields, dict):
        fields["NAME"] = translate_label(str(fields["NAME"]))
    for note in _dicts_in_list(result.get("workspaceComments")):
        note["text"] = translate_text(NOTE, str(note.get("text", "")))
    for variable in _dicts_in_list(result.get("variables")):
        variable["name"] = translate_label(str(variable["name"]))
    state = result.get("extraState")
    if isinstance(state, dict):
        for named_entry in (state, *_dicts_in_list(state.get("inputs"))):
            if "name" in named_entry:
                named_entry["name"] = translate_label(str(named_entry["name"]))
    return result


def _dicts_in_list(value: object) -> list[dict[str, object]]:
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []


def _has_letters(text: object) -> bool:
    return isinstance(text, str) and any(map(str.isalpha, text))
