"""Position and reason of JSON syntax errors, for editors, the command line and files written by people."""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass

import orjson

from nep.i18n import _
from nep.text import shortened

_MAX_WORD_LENGTH = 30
_STRING_OR_CONSTANT = re.compile(r'"(?:[^"\\\n]|\\.)*"?|(?P<constant>-?\b(?:NaN|Infinity)\b)')
_WORD_PATTERN = re.compile(r"[^\W\d][\w.-]*")
_CLOSING_BRACKETS = {"{": "}", "[": "]"}
_FOREIGN_CONSTANTS = {"True": "true", "False": "false", "None": "null", "undefined": "null", "nil": "null"}
_JSON_START = re.compile(r'\s*(?:[{["]|-?\d|-?(?:Infinity|NaN)\b|(?:true|false|null)\b)')


@dataclass(frozen=True, slots=True)
class JsonFix:
    """Edit that fixes a syntax error.

    Attributes:
        start: Index of the first character to replace.
        end: Index after the last character to replace.
        text: Replacement.
    """

    start: int
    end: int
    text: str


@dataclass(frozen=True, slots=True)
class JsonFault:
    """First syntax error in a JSON text.

    Attributes:
        line: Line number, from 1.
        column: Column number, from 1.
        reason: Reason for use within a sentence: lower case, no full stop.
        fix: Edit that fixes the error, or None.
        is_nan: True if the error is NaN or an infinity, which Python's ``json`` writes and msgpack supports.
    """

    line: int
    column: int
    reason: str
    fix: JsonFix | None = None
    is_nan: bool = False

    @property
    def message(self) -> str:
        """Description of the error as a sentence for the window."""
        return _("Line {line}, column {column}: {reason}.").format(
            line=self.line, column=self.column, reason=self.reason
        )


def looks_like_json(text: str) -> bool:
    """Return True if `text` begins like JSON, so that it was probably meant as JSON."""
    return _JSON_START.match(text) is not None


def find_json_fault(text: str, *, allow_nan: bool = False) -> JsonFault | None:
    """Return the first syntax error of `text`, or None if nep can publish it as JSON.

    With `allow_nan`, NaN and Infinity are accepted as values.
    """
    try:
        json.loads(text, parse_constant=float if allow_nan else _reject_constant, parse_float=_parse_finite)
    except json.JSONDecodeError as error:
        return _explain(text, error)
    except _ConstantError:
        return _constant_fault(text)
    except RecursionError:
        return JsonFault(1, 1, _("too many nested levels"))
    except ValueError:  # Python limits the digits of ints, and parses 1e999 as infinity
        return JsonFault(1, 1, _("a number is too large"))
    return None if allow_nan else _orjson_fault(text)


def _orjson_fault(text: str) -> JsonFault | None:
    # Accepted by Python's parser, but not by orjson: surrogates, deep nesting.
    try:
        orjson.loads(text)
    except orjson.JSONDecodeError as error:
        if "depth" in error.msg:
            return JsonFault(1, 1, _("too many nested levels"))
        if "infinity" in error.msg:
            return JsonFault(1, 1, _("a number is too large"))
        return _fault_at(text, error.pos, _("an unpaired surrogate isn't a character"))
    return None


class _ConstantError(Exception):
    pass


def _reject_constant(_constant: str) -> object:
    raise _ConstantError


def _parse_finite(digits: str) -> float:
    value = float(digits)
    if math.isinf(value):
        raise ValueError(digits)
    return value


def _constant_fault(text: str) -> JsonFault:
    match = next(each for each in _STRING_OR_CONSTANT.finditer(text) if each["constant"] is not None)
    fix = JsonFix(match.start(), match.end(), "null")
    return _fault_at(
        text, match.start(), _("{word} isn't JSON; use null").format(word=match[0]), fix, is_nan=True
    )


def _fault_at(
    text: str, position: int, reason: str, fix: JsonFix | None = None, *, is_nan: bool = False
) -> JsonFault:
    line = text.count("\n", 0, position) + 1
    column = position - (text.rfind("\n", 0, position) + 1) + 1
    return JsonFault(line, column, reason, fix, is_nan)


def _explain(text: str, error: json.JSONDecodeError) -> JsonFault:
    position, message = error.pos, error.msg
    if not text.strip():
        reason = _("the text is empty; write JSON, such as {example}").format(example='{"x": 1}')
        return _fault_at(text, 0, reason)
    if message.startswith(("Unterminated", "Invalid control")):
        return _invalid_string_fault(text, position)
    if message.startswith("Invalid \\"):
        fix = JsonFix(position, position, "\\") if text[position : position + 1] == "\\" else None
        return _fault_at(text, position, _("a string contains a single \\; use \\\\"), fix)
    if message.startswith("Extra data"):
        return _fault_at(text, position, _("there is extra text after the first value"))
    if message.startswith("Illegal trailing comma"):
        return _trailing_comma_fault(text, text.rfind(",", 0, position + 1))
    return _unexpected_character_fault(text, position, message)


def _unexpected_character_fault(text: str, position: int, message: str) -> JsonFault:
    character, end = text[position : position + 1], len(text[:position].rstrip())
    previous = text[end - 1 : end]
    if character in {"}", "]"} and previous == ",":
        return _trailing_comma_fault(text, end - 1)
    if message.startswith("Expecting ':'"):
        return _fault_at(text, end, _("a colon is missing after the name"), JsonFix(end, end, ":"))
    if not character:
        return _unclosed_bracket_fault(text, end)
    if message.startswith("Expecting ','"):
        return _missing_comma_fault(text, position, end)
    if character in {"}", "]", ","} and previous == ":":
        return _fault_at(text, end, _("a value is missing after the colon"))
    return _missing_value_fault(text, position, is_name=message.startswith("Expecting property name"))


def _trailing_comma_fault(text: str, position: int) -> JsonFault:
    return _fault_at(text, position, _("there is an extra comma"), JsonFix(position, position + 1, ""))


def _missing_comma_fault(text: str, position: int, end: int) -> JsonFault:
    character = text[position]
    if character in {"}", "]"}:
        return _fault_at(text, position, _("{sign} doesn't match the opening bracket").format(sign=character))
    if position == end and (character.isalnum() or character in "._"):
        return _fault_at(text, position, _("JSON doesn't support this number"))
    return _fault_at(text, end, _("a comma is missing between two values"), JsonFix(end, end, ","))


def _unclosed_bracket_fault(text: str, end: int) -> JsonFault:
    open_brackets: list[str] = []
    for match in re.finditer(r'"(?:[^"\\\n]|\\.)*"|[{}\[\]]', text):
        token = match[0]  # a string or a bracket
        if token in _CLOSING_BRACKETS:
            open_brackets.append(token)
        elif token in {"}", "]"} and open_brackets:
            open_brackets.pop()
    if not open_brackets:
        return _fault_at(text, end, _("a value is missing at the end"))
    missing = "".join(_CLOSING_BRACKETS[bracket] for bracket in reversed(open_brackets))
    fix = JsonFix(end, end, missing) if text[end - 1] not in ",:" else None
    shown_brackets = shortened(missing, _MAX_WORD_LENGTH)
    return _fault_at(
        text, end, _("a closing {signs} is missing at the end").format(signs=shown_brackets), fix
    )


def _missing_value_fault(text: str, position: int, *, is_name: bool) -> JsonFault:
    match = _WORD_PATTERN.match(text, position)
    if text[position] == "'":
        end = text.find("'", position + 1)
        quoted = text[position + 1 : end] if end > position else ""
        is_plain = bool(quoted) and not any(character in quoted for character in '"\\\n')
        fix = JsonFix(position, end + 1, f'"{quoted}"') if is_plain else None
        return _fault_at(text, position, _("JSON needs double quotes, not single quotes"), fix)
    if match is None:
        reason = _("a name in double quotes is expected") if is_name else _("a value is expected")
        return _fault_at(text, position, reason)
    replacement = _FOREIGN_CONSTANTS.get(match[0])
    if replacement is not None and not is_name:
        fix = JsonFix(position, match.end(), replacement)
        return _fault_at(
            text,
            position,
            _("use {right} instead of {word} in JSON").format(word=match[0], right=replacement),
            fix,
        )
    shown_word = shortened(match[0], _MAX_WORD_LENGTH)
    fix = JsonFix(position, match.end(), f'"{match[0]}"')
    return _fault_at(text, position, _("{word} needs double quotes").format(word=shown_word), fix)


def _invalid_string_fault(text: str, position: int) -> JsonFault:
    # No closing quote, or a character that must be escaped.
    character = text[position : position + 1]
    if character == "\t":
        fix = JsonFix(position, position + 1, "\\t")
        return _fault_at(text, position, _("a string contains a tab character; use \\t"), fix)
    if character and character not in {'"', "\n", "\r"}:
        return _fault_at(text, position, _("a string contains an invisible character; delete it"))
    start = text.rfind("\n", 0, position) + 1
    end = text.find("\n", position)
    line = text[start : end if end >= 0 else len(text)].rstrip()
    closing_position = start + len(line[:-1].rstrip() if line.endswith(",") else line)
    return _fault_at(
        text, position, _("a string has no closing quote"), JsonFix(closing_position, closing_position, '"')
    )
