"""Commands for variables of the current behaviour: create, rename, delete, watch, find uses, set values."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain, count
from typing import TYPE_CHECKING, Protocol, runtime_checkable

from app.blocks.model.workspace import PlacedBlock, Workspace, parse_workspace
from app.core.session import Session
from app.robots.description.typed_number import TypedNumberError, parse_number
from app.ui.shell.commands.shell import Shell
from app.ui.shell.projects import ProjectController
from nep.i18n import _, ngettext, pgettext
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from app.ui.shell.dialogs import name as name_sheet
else:
    name_sheet = lazy_module("app.ui.shell.dialogs.name")

MAX_NAME_LENGTH = 60


@runtime_checkable
class SupportsVariables(Protocol):
    """Interface of a panel in which variables can be edited."""

    def edit_variable(self, edit: Mapping[str, object]) -> None:
        """Apply an edit of a variable as one step on the undo stack.

        Args:
            edit: Edit for the page of the block editor: "do" with "new", "rename", "delete", "watch",
                "show" or "undo", and the arguments.
        """


class VariableCommands:
    """Handlers of the commands for variables.

    The handlers ask for names and show toasts; the block editor applies the edits.
    """

    def __init__(self, shell: Shell, session: Session, files: ProjectController) -> None:
        self._shell, self._session, self._files = shell, session, files
        self._sheet: name_sheet.NameSheet | None = None
        self._last_found_ids: dict[str, str] = {}  # id of the block found last, by variable

    def new(self, *, is_list: bool) -> None:
        """Ask for a name, then create a variable, or a list if `is_list`."""
        question = _("New list") if is_list else _("New variable")
        verb = _("Create")

        def ask_name() -> None:
            callback = lambda name: self._edit({"do": "new", "name": name, "list": is_list})  # noqa: E731
            self._get_name_sheet().ask(
                question, verb, self.rejection_reason, callback, self._free_name(is_list=is_list)
            )

        self._run_after_flush(ask_name)

    def _free_name(self, *, is_list: bool) -> str:
        # Suggests a name so that none has to be typed: "count", "count 2", "count 3".
        base_name = pgettext("variable", "list") if is_list else pgettext("variable", "count")
        return next(
            name
            for name in chain([base_name], (f"{base_name} {n}" for n in count(2)))
            if not self.rejection_reason(name)
        )

    def ask_rename(self, id: str) -> None:
        """Ask for a new name and rename the variable with this id."""

        def ask_name() -> None:
            workspace = self._workspace()
            old_name = workspace.variables.get(id)
            if old_name is None:
                return
            has_name = id not in workspace.nameless_variables
            self._get_name_sheet().ask(
                _("New name for “{name}”").format(name=old_name) if has_name else _("Variable name"),
                _("Rename") if has_name else _("Name the variable"),
                lambda name: "" if name == old_name else self.rejection_reason(name, id),
                lambda name: self._edit({"do": "rename", "id": id, "name": name}),
                old_name if has_name else "",
            )

        self._run_after_flush(ask_name)

    def delete(self, id: str) -> None:
        """Delete a variable and the blocks that use it, and show a toast with an Undo button."""

        def delete() -> None:
            workspace = self._workspace()
            name, count = workspace.variables.get(id), len(uses_of(workspace, id))
            if name is None:
                return
            self._edit({"do": "delete", "id": id})
            message = _("Deleted “{name}”").format(name=name)
            if count:
                message = ngettext(
                    "Deleted “{name}” and {count} block that used it",
                    "Deleted “{name}” and {count} blocks that used it",
                    count,
                ).format(name=name, count=count)
            self._shell.show_toast(message, _("Undo"), lambda: self._edit({"do": "undo"}))

        self._run_after_flush(delete)

    def toggle_watch(self, id: str) -> None:
        """Show or hide the value of the variable with this id next to the blocks."""
        self._edit({"do": "watch", "id": id})

    def show_next_use(self, id: str) -> None:
        """Scroll to the next block that uses the variable with this id, wrapping around."""

        def show() -> None:
            uses = uses_of(self._workspace(), id)
            last_id = self._last_found_ids.get(id, "")
            if uses:
                index = (uses.index(last_id) + 1) % len(uses) if last_id in uses else 0
                self._last_found_ids = {id: uses[index]}
                self._edit({"do": "show", "id": uses[index]})

        self._run_after_flush(show)

    def ask_value(self, id: str) -> None:
        """Ask for a value and assign it to a variable of the running program."""
        runs = self._session.runs
        name = self._workspace().variables.get(id)
        current_value = runs.values.get(id)
        if name is None or not runs.active:
            return

        def set_value(text: str) -> None:
            if not runs.set_variable(id, parse_value(text)):
                self._shell.show_toast(_("The behaviour ended: “{name}” wasn't changed").format(name=name))

        is_number = current_value is not None and current_value.kind == "number"
        self._get_name_sheet().ask(
            _("New value for “{name}”").format(name=name),
            _("Apply"),
            lambda words: separator_problem(words) if is_number else "",
            set_value,
            current_value.text
            if current_value is not None and current_value.kind in ("number", "text", "boolean")
            else "",
        )

    def rejection_reason(self, name: str, own_id: str = "") -> str:
        """Return the reason why a variable name is invalid, as a sentence, or "".

        Args:
            name: Name to check.
            own_id: Id of the variable that is renamed, which may keep its name; "" for a new variable.
        """
        if not name:
            return _("Enter a name for the variable.")
        if len(name) > MAX_NAME_LENGTH:
            return _("This name is too long. Use at most {most} characters.").format(most=MAX_NAME_LENGTH)
        existing_names = {each.casefold() for id, each in self._workspace().variables.items() if id != own_id}
        if name.casefold() in existing_names:
            return _("A variable named “{name}” already exists. Choose another name.").format(name=name)
        return ""

    def _run_after_flush(self, act: Callable[[], None]) -> None:
        self._shell.show_layout("behaviour")
        self._files.run_after_flush(act)

    def _workspace(self) -> Workspace:
        return parse_workspace(self._session.document.workspace)

    def _edit(self, edit: Mapping[str, object]) -> None:
        editor = self._shell.editor()
        if isinstance(editor, SupportsVariables):
            editor.edit_variable(edit)

    def _get_name_sheet(self) -> name_sheet.NameSheet:
        if self._sheet is None:
            self._sheet = name_sheet.NameSheet(self._shell.theme, self._shell.surface)
        return self._sheet


def uses_of(workspace: Workspace, id: str) -> list[str]:
    """Return the ids of the blocks that set, change or read a variable, in the order of the page."""
    block_ids: list[str] = []
    pending_blocks: list[PlacedBlock] = [
        block for script in reversed(workspace.scripts) for block in reversed(script)
    ]
    while pending_blocks:
        block = pending_blocks.pop()
        if any(_refers_to(value, id) for value in block.fields.values()):
            block_ids.append(block.id)
        pending_blocks += [
            each for chain in reversed(list(block.inputs.values())) for each in reversed(chain)
        ]
    return block_ids


def _refers_to(field: object, id: str) -> bool:
    return isinstance(field, Mapping) and field.get("id") == id


def separator_problem(text: str) -> str:
    """Return an error sentence if the text is a number with ambiguous separators, else ""."""
    try:
        parse_number(text)
    except TypedNumberError as error:
        return str(error) if error.has_separators else ""
    return ""


def parse_value(text: str) -> str | float | bool:
    """Parse a typed value of a variable.

    Returns:
        A number, a boolean for "yes", "no" (in the user's language), "true" or "false", or else the
        text.
    """
    stripped = text.strip()
    folded = stripped.casefold()
    if folded in ("true", _("yes").casefold()):
        return True
    if folded in ("false", _("no").casefold()):
        return False
    try:
        number = parse_number(stripped)
        return int(stripped) if stripped.lstrip("+-").isdecimal() else number
    except ValueError:
        return text
