"""Validation of robot descriptions by the profile's JSON Schema, and by rules that a schema can't express.

The schema is ``resources/robots/robot-profile.schema.json``; the README in the same folder documents its
terms.
"""

from __future__ import annotations

import json
import re
from collections import deque
from collections.abc import Iterator, Mapping
from functools import lru_cache
from itertools import count, islice
from typing import TYPE_CHECKING

from app import resources
from app.robots.description.inputs import parameter_of, value_problem
from app.robots.description.json_access import as_object, names, object_member
from nep.i18n import _, format_list, lazy
from nep.text import bounded_str, first_control, strip_controls

if TYPE_CHECKING:
    from jsonschema import Draft7Validator
    from jsonschema.exceptions import ValidationError

PLACEHOLDER = re.compile(r"%([A-Za-z_][A-Za-z0-9_-]*)")
_MAX_PROBLEMS = 20
_MAX_DEPTH = 40
MAX_VALUES = 20_000
"""Maximum number of values in a description. Checking a value takes about 0.05 ms; Pepper has 900 values."""
_BLOCK_MEMBER = "rb:block"
_TEXT_MEMBERS = frozenset({"title", "description", "unit", "vendor", _BLOCK_MEMBER})
"""Members of a description that are texts for the user or contain such texts."""
_VALUE_MEMBERS = frozenset({"default", "enum", "const"})
_MAX_NUMBER = 1e15
_accepted_descriptions: deque[str] = deque(maxlen=8)
"""JSON texts of recently accepted descriptions, because a robot publishes the same description repeatedly."""
_RESERVED_NAMES = {"description", "command", "answer", "state", "world"}


@lru_cache(maxsize=1)
def _validator() -> Draft7Validator:
    # jsonschema is slow to import: only for the first robot.
    from jsonschema import Draft7Validator  # noqa: PLC0415

    schema = json.loads(resources.path("robots", "robot-profile.schema.json").read_text(encoding="utf-8"))
    return Draft7Validator(schema)


def validate(model: object) -> tuple[str, ...]:
    """Return the problems of a Thing Model or Thing Description; empty if it is valid.

    Each problem is one message; at most 20 are returned. Contradictions are checked only if there is no
    other problem.
    """
    if not isinstance(model, Mapping):
        return (_("a description must be a JSON object"),)
    model = dict(model)
    json_problem = _json_problem(model, count(1))
    if json_problem is not None:
        return (json_problem,)
    text, problems = json.dumps(model), []
    if text not in _accepted_descriptions:
        problems = [_error_message(error) for error in islice(_validator().iter_errors(model), _MAX_PROBLEMS)]
        if not problems:
            _accepted_descriptions.append(text)
    control_character = first_control(str(model.get("title")))
    if control_character:
        problems.append(
            _("title: '{control}' can't be used in a name because it is invisible").format(
                control=control_character
            )
        )
    if not problems:
        problems = list(_contradictions(model))
    if not problems and (cleaned_model := without_control_characters(model)) != model:
        return validate(cleaned_model)  # removing control characters may leave an empty text
    return tuple(dict.fromkeys(problems))[:_MAX_PROBLEMS]


def without_control_characters(document: Mapping[str, object]) -> dict[str, object]:
    """Return a description without control characters in texts for the user.

    Names are not changed; `validate` checks them. A bidirectional control character in the title of an action
    would also reorder the text after it, such as the question whether the robot may move.
    """

    def clean(value: object, member: str) -> object:
        if member in _VALUE_MEMBERS:
            return value
        if isinstance(value, Mapping):
            return {
                key: clean(item, member if member == _BLOCK_MEMBER else key) for key, item in value.items()
            }
        if isinstance(value, (list, tuple)):
            return [clean(item, "") for item in value]
        return strip_controls(value) if isinstance(value, str) and member in _TEXT_MEMBERS else value

    return {key: clean(item, "" if key == "title" else key) for key, item in document.items()}


def _json_problem(value: object, counter: Iterator[int], path: str = "", depth: int = 0) -> str | None:
    # Also rejects `$ref`, unusable numbers, and more than `MAX_VALUES` values, counted by `counter`.
    if next(counter) > MAX_VALUES or depth > _MAX_DEPTH:
        if depth > _MAX_DEPTH:
            return _("{place} is nested too deeply").format(place=path)
        return _("the description has more than {count} values").format(count=MAX_VALUES)
    if isinstance(value, dict):
        for key, item in value.items():
            problem = _key_problem(key, path or _(DESCRIPTION_LABEL)) or _json_problem(
                item, counter, f"{path}.{key}" if path else str(key), depth + 1
            )
            if problem is not None:
                return problem
        return None
    if isinstance(value, list):
        problems = (
            _json_problem(item, counter, f"{path}[{index}]", depth + 1) for index, item in enumerate(value)
        )
        return next((problem for problem in problems if problem is not None), None)
    if isinstance(value, (int, float)) and not -_MAX_NUMBER <= value <= _MAX_NUMBER:
        return _("{place} isn't a finite number, or is too large").format(place=path)
    if value is None or isinstance(value, (str, bool, int, float)):
        return None
    return _("{place} isn't JSON: {kind}").format(place=path, kind=type(value).__name__)


def _key_problem(key: object, location: str) -> str | None:
    if not isinstance(key, str):
        return _("{place} has a name that isn't text: {name}").format(place=location, name=repr(key))
    if key == "$ref":
        return _("{place} uses $ref, which isn't supported; write the definition inline").format(
            place=location
        )
    return None


# ---- sentences for schema errors ----------------------------------------------------------

_TYPE_NAMES = {
    "string": lazy("text"),
    "number": lazy("a number"),
    "integer": lazy("a whole number"),
    "boolean": lazy("true or false"),
    "object": lazy("an object"),
    "array": lazy("a list"),
    "null": "null",
}


_EMPTY_MESSAGE = lazy("{place} must not be empty")
_TOO_LONG_MESSAGE = lazy("{place} has more than {limit} entries")
_RULE_MESSAGES = {
    "minimum": lazy("{place} must be at least {limit}"),
    "exclusiveMinimum": lazy("{place} must be greater than {limit}"),
    "maximum": lazy("{place} must be at most {limit}"),
    "minLength": _EMPTY_MESSAGE,
    "maxLength": lazy("{place} is longer than {limit} characters"),
    "minItems": _EMPTY_MESSAGE,
    "minProperties": _EMPTY_MESSAGE,
    "maxItems": _TOO_LONG_MESSAGE,
    "maxProperties": _TOO_LONG_MESSAGE,
    "anyOf": lazy("{place} doesn't match any allowed format"),
}
INVALID_MESSAGE = lazy("{place} isn't valid")
DESCRIPTION_LABEL = lazy("the description")


def _error_message(error: ValidationError) -> str:
    location = ".".join(str(part) for part in error.absolute_path) or _(DESCRIPTION_LABEL)
    rule = str(error.validator)
    limit: object = error.validator_value
    if rule == "required":  # jsonschema names the missing property only in its message
        return _("{place} has no '{name}'").format(place=location, name=error.message.split("'")[1])
    if rule == "type":
        kinds = limit if isinstance(limit, list) else [limit]
        type_names = format_list([_(_TYPE_NAMES.get(str(kind), str(kind))) for kind in kinds], "or")
        return _("{place} must be {kinds}").format(place=location, kinds=type_names)
    if rule == "enum":
        return _("{place} must be one of {names}").format(place=location, names=", ".join(names(limit)))
    if rule == "const":
        return _("{place} must be {value}").format(place=location, value=limit)
    if rule == "pattern":
        quoted = _shorten_and_quote(error.instance)
        return _("{place}: {value} isn't allowed; use letters, digits, - and _ without spaces").format(
            place=location, value=quoted
        )
    return _(_RULE_MESSAGES.get(rule, INVALID_MESSAGE)).format(place=location, limit=limit)


def _shorten_and_quote(value: object) -> str:
    text = bounded_str(value, 41)
    return f"'{text[:40]}…'" if len(text) > 40 else f"'{text}'"


# ---- rules beyond the schema ----------------------------------------------------------------------


def _contradictions(model: Mapping[str, object]) -> Iterator[str]:
    actions = object_member(model, "actions")
    properties = object_member(model, "properties")
    stop = bounded_str(object_member(model, "rb:safeStop").get("action"))
    if stop not in actions:
        yield _("rb:safeStop.action names '{stop}', which isn't an action").format(stop=stop)
    elif object_member(object_member(actions, stop), "input").get("required"):
        yield _("'{stop}' is the safe stop, so its input must not have required fields").format(stop=stop)
    resources_named = set(names(model.get("rb:resources")))
    for name in (set(properties) | _RESERVED_NAMES) & set(object_member(model, "events")) | set(
        properties
    ) & _RESERVED_NAMES:
        yield _(
            "'{name}' is reserved or used twice; each sensor and event needs a different name, "
            "because the name becomes a topic"
        ).format(name=name)
    for name, action in actions.items():
        yield from _action_contradictions(name, as_object(action), resources_named, properties)
    for name, sensor in properties.items():
        yield from _data_contradictions(f"properties.{name}", as_object(sensor))
    for name, event in object_member(model, "events").items():
        event_object = as_object(event)
        data = object_member(object_member(event_object, "data"), "properties")
        yield from _field_contradictions(f"events.{name}.data", data)
        for field in names(event_object.get("rb:filter")):
            if field not in data:
                yield _("events.{name}.rb:filter names '{field}', which isn't in its data").format(
                    name=name, field=field
                )
        yield from _text_contradictions(f"events.{name}", event_object, data)


def _action_contradictions(
    name: str, action: Mapping[str, object], resources_named: set[str], properties: Mapping[str, object]
) -> Iterator[str]:
    fields = object_member(object_member(action, "input"), "properties")
    yield from _field_contradictions(f"actions.{name}.input", fields)
    for field in names(object_member(action, "input").get("required")):
        if field not in fields:
            yield _("actions.{name}.input requires '{field}', which it doesn't define").format(
                name=name, field=field
            )
    for resource in names(action.get("rb:uses")):
        if resource not in resources_named:
            yield _("actions.{name}.rb:uses names '{used}', which isn't in rb:resources").format(
                name=name, used=resource
            )
    for field, data in fields.items():
        source = as_object(data).get("rb:optionsFrom")
        if source is not None and source not in properties:
            yield _(
                "actions.{name}.input.{field} takes its options from '{source}', which isn't a property"
            ).format(name=name, field=field, source=source)
    yield from _text_contradictions(f"actions.{name}", action, fields)


def _field_contradictions(location: str, fields: Mapping[str, object]) -> Iterator[str]:
    for name, data in fields.items():
        if name == "robot":
            yield _("{place}: the name 'robot' is reserved; use another name").format(place=location)
        yield from _data_contradictions(f"{location}.{name}", as_object(data))


def _data_contradictions(location: str, data: Mapping[str, object]) -> Iterator[str]:
    low, high = data.get("minimum"), data.get("maximum")
    if isinstance(low, (int, float)) and isinstance(high, (int, float)) and low > high:
        yield _("{place}: minimum {low} is greater than maximum {high}").format(
            place=location, low=low, high=high
        )
    elif data.get("default") is not None:
        default = _("{place}: the default").format(place=location)
        problem = value_problem(parameter_of(location, data), data["default"], default)
        if problem is not None:
            yield problem


def _text_contradictions(
    location: str, owner: Mapping[str, object], fields: Mapping[str, object]
) -> Iterator[str]:
    block = object_member(owner, "rb:block")
    for kind in ("text", "says"):
        for language, text in object_member(block, kind).items():
            placeholders = PLACEHOLDER.findall(str(text))
            for name in placeholders:
                if name != "robot" and name not in fields:
                    yield _("{place}.rb:block.{kind}.{language} uses %{name}, which isn't defined").format(
                        place=location, kind=kind, language=language, name=name
                    )
            if kind == "text" and len(placeholders) != len(set(placeholders)):
                yield _("{place}.rb:block.text.{language} uses a value twice").format(
                    place=location, language=language
                )
