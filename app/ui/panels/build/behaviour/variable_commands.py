"""Commands for variables of the current behaviour: create, rename, delete, watch and find uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain, count

from app.blocks.model.workspace import PlacedBlock, Workspace, parse_workspace
from app.ui.panels.base import PanelContext
from nep.i18n import _, ngettext, pgettext

MAX_NAME_LENGTH = 60


class VariableCommands:
    """Handlers of the commands for variables.

    The handlers ask for names and show toasts; the block editor applies the edits.

    Args:
        context: Functions of the window.
        flush: Applies pending edits of the blocks, then calls a function.
        edit: Applies an edit of a variable as one step on the undo stack; it is a JSON object for the page
            of the block editor, with "new", "rename", "delete", "watch", "show" or "undo" in "do".
    """

    def __init__(
        self,
        context: PanelContext,
        flush: Callable[[Callable[[], None]], object],
        edit: Callable[[Mapping[str, object]], object],
    ) -> None:
        self._context, self._flush, self._edit = context, flush, edit
        self._last_found_ids: dict[str, str] = {}  # id of the block found last, by variable

    def new(self, *, is_list: bool) -> None:
        """Ask for a name, then create a variable, or a list if `is_list`."""
        question = _("New list") if is_list else _("New variable")
        verb = _("Create")

        def ask_name() -> None:
            callback = lambda name: self._edit({"do": "new", "name": name, "list": is_list})  # noqa: E731
            self._context.ask_name(
                question, verb, self.rejection_reason, callback, self._free_name(is_list=is_list)
            )

        self._flush(ask_name)

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
            self._context.ask_name(
                _("New name for “{name}”").format(name=old_name) if has_name else _("Variable name"),
                _("Rename") if has_name else _("Name the variable"),
                lambda name: "" if name == old_name else self.rejection_reason(name, id),
                lambda name: self._edit({"do": "rename", "id": id, "name": name}),
                old_name if has_name else "",
            )

        self._flush(ask_name)

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
            self._context.show_toast(message, _("Undo"), lambda: self._edit({"do": "undo"}))

        self._flush(delete)

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

        self._flush(show)

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

    def _workspace(self) -> Workspace:
        return parse_workspace(self._context.session.document.workspace)


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
