"""Python names of variables, functions and scripts: unique in a page, and made unique in a program later."""

from __future__ import annotations

from dataclasses import dataclass

from app.blocks.model.names import PythonNames
from app.blocks.runtime.pure import calculation, clock, lists, texts
from app.blocks.toolbox.catalogue import function_modules

COMMANDS = frozenset(
    {
        "answer", "ask", "ask_with_choices", "broadcast", "broadcast_and_wait", "fail", "is_known", "join",
        "length", "newest", "on_broadcast", "on_message", "on_start", "on_true", "part", "publish",
        "random_number", "repeat", "reset_timer", "robot", "rounded", "rounded_down", "rounded_up", "run",
        "stop_others", "stop_program", "stop_script", "timer", "wait", "wait_until", "write",
        *calculation.__all__, *clock.__all__, *lists.__all__, *texts.__all__,
    }
)  # fmt: skip
"""Names of the functions in `app.blocks.commands` that a program can call."""
_OTHER_NAMES = frozenset({"step", "value", "number", "called", "message", "_"})

SharedKey = tuple[str, str]
"""Kind ("variable" or "function") and id of something that several pages can use."""


def callable_names() -> frozenset[str]:
    """Return the names of all functions that a program can call, including those of categories."""
    return COMMANDS | function_modules().keys()


def reserved_names() -> frozenset[str]:
    """Return the names that variables and functions of the user can't have."""
    return callable_names() | _OTHER_NAMES


@dataclass(frozen=True)
class NameRequest:
    """Name that a page uses, with what is needed to choose its name in the program.

    Attributes:
        text: Text from which the name is derived.
        fallback: Name to use if the text contains no valid character.
        local_name: Name in the page.
        shared_key: Key of the variable or function; None for a name that only this page uses.
    """

    text: str
    fallback: str
    local_name: str
    shared_key: SharedKey | None = None


class PageNames:
    """Generator of the names in one page.

    Attributes:
        requests: All names in the order in which they were created.
    """

    def __init__(self) -> None:
        self._names = PythonNames(reserved_names())
        self.requests: list[NameRequest] = []

    def new_name(self, text: str, fallback: str, shared_key: SharedKey | None = None) -> str:
        """Return a new name that is unique in the page.

        Args:
            text: Text from which the name is derived.
            fallback: Name to use if the text contains no valid character.
            shared_key: Key of the variable or function that has this name in all pages.
        """
        local_name = self._names.new_name(text, fallback)
        self.requests.append(NameRequest(text, fallback, local_name, shared_key))
        return local_name


class ProgramNames:
    """Generator of the names in a program. The names of its first page are those in the page."""

    def __init__(self) -> None:
        self._names = PythonNames(reserved_names())
        self._shared_names: dict[SharedKey, str] = {}

    def names_of(self, requests: tuple[NameRequest, ...]) -> dict[str, str]:
        """Return the names of the next page in the program, by its name in the page."""
        names = {}
        for request in requests:
            name = self._shared_names.get(request.shared_key) if request.shared_key is not None else None
            if name is None:
                name = self._names.new_name(request.text, request.fallback)
                if request.shared_key is not None:
                    self._shared_names[request.shared_key] = name
            names[request.local_name] = name
        return names
