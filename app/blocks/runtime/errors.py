"""What went wrong, in a sentence for people."""

from __future__ import annotations

from app.errors import AppError
from nep.i18n import listed

_KINDS = {
    "int": "a number",
    "float": "a number",
    "bool": "true or false",
    "str": "a text",
    "list": "a list",
    "dict": "a message",
    "NoneType": "nothing",
}


class BehaviourError(AppError):
    """A block can't go on. ``block`` is its id once it is known.

    ``unknown`` says that only a value is missing.
    """

    def __init__(self, sentence: str, block: str | None = None, *, unknown: bool = False) -> None:
        """Keep the sentence that appears on the block."""
        super().__init__(sentence)
        self.block = block
        self.unknown = unknown


def explain(error: Exception, label: str, block: str | None) -> BehaviourError:
    """The error of a block in words; `label` names the block."""
    if isinstance(error, BehaviourError):
        error.block = error.block or block
        return error
    name = f"“{label}”" if label else "this block"
    if isinstance(error, AppError):
        return BehaviourError(f"{name}: {error.sentence}.", block)
    if isinstance(error, ZeroDivisionError):
        return BehaviourError(f"{name} can't divide by 0.", block)
    if isinstance(error, (OverflowError, MemoryError)):
        return BehaviourError(f"{name} gives something too large.", block)
    if isinstance(error, RecursionError):
        return BehaviourError(f"{name} is nested too deep.", block)
    if isinstance(error, TypeError):
        if "NoneType" in str(error):
            return BehaviourError(f"{name} needs a value that is not known yet.", block, unknown=True)
        return BehaviourError(f"{name} can't do this with {_kinds(str(error))}.", block)
    return BehaviourError(f"{name} failed: {error}.", block)


def kind(value: object) -> str:
    """What a value is, in words: "a text"."""
    return _KINDS.get(type(value).__name__, "something else")


def _kinds(sentence: str) -> str:
    """The kinds that Python names in its sentence: "a text and a number"."""
    words = [word for quoted, word in _KINDS.items() if f"'{quoted}'" in sentence]
    return listed(list(dict.fromkeys(words))) or "these values"
