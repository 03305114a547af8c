"""Saved layouts: the last arrangements of the built-in layouts, and custom layouts.

A custom layout is based on a built-in one and also has a last arrangement. Saved entries that are no
longer valid are skipped and reported in the Console.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from app.ui.shell.docking.layouts import LAYOUTS, layout_named
from app.ui.shell.docking.workbench import Workbench
from app.ui.shell.window_state import WindowState
from nep.i18n import _

CUSTOM_PREFIX = "own:"
MAX_NAME_LENGTH = 40


@dataclass(frozen=True, slots=True)
class CustomLayout:
    """Custom layout, with the name of the built-in layout on which it is based."""

    name: str
    base: str


class SavedLayouts:
    """Store of the arrangements of all layouts, which also records the current layout of each workbench.

    In its methods, ``base`` is the name of a workbench's built-in layout.
    """

    def __init__(self, state: WindowState, report_error: Callable[[str], object]) -> None:
        # `report_error` is called with a message about damaged entries.
        self._state, self._report_error = state, report_error
        self._current: dict[str, str] = {}

    def all(self) -> tuple[CustomLayout, ...]:
        """Return all custom layouts, sorted by name."""
        bases = {layout.name for layout in LAYOUTS}
        layouts = []
        for key, saved in self._state.layouts().items():
            if key.startswith(CUSTOM_PREFIX) and isinstance(saved, Mapping) and saved.get("base") in bases:
                layouts.append(CustomLayout(key.removeprefix(CUSTOM_PREFIX), str(saved["base"])))
        return tuple(sorted(layouts, key=lambda layout: layout.name.lower()))

    def named(self, name: str) -> CustomLayout | None:
        """Return the custom layout with this name, or None."""
        return next((layout for layout in self.all() if layout.name == name), None)

    def custom_name(self, base: str) -> str:
        """Return the name of the custom layout that a workbench shows, or "" for the built-in one."""
        name = self._current.get(base)
        if name is None:
            name = self._current[base] = self._state.selected_layout(base)
        layout = self.named(name) if name else None
        return name if layout is not None and layout.base == base else ""

    def rejection_reason(self, name: str, allowed_name: str = "") -> str:
        """Return why a name for a custom layout is invalid, as a sentence; "" if it is valid.

        Args:
            name: Name to check.
            allowed_name: Existing name that is allowed, because that layout is being renamed.
        """
        name = name.strip()
        if not name:
            return _("Enter a name for the layout.")
        if len(name) > MAX_NAME_LENGTH:
            return _("The name is too long. Use at most {count} characters.").format(count=MAX_NAME_LENGTH)
        taken_names = {_(layout.title).lower() for layout in LAYOUTS} | {
            custom.name.lower() for custom in self.all()
        }
        is_taken = name.lower() in taken_names - {allowed_name.lower()}
        return _("“{name}” already exists.").format(name=name) if is_taken else ""

    def restore(self, bench: Workbench, base: str) -> None:
        """Restore the last arrangement of a workbench; if there is none or it is invalid, use the default."""
        name = self.custom_name(base)
        saved = self._state.layout_state(CUSTOM_PREFIX + name if name else base)
        if not saved:
            bench.reset_layout()
            return
        try:
            is_restored = bench.restore(saved)
        except Exception as error:  # noqa: BLE001  whatever was in the file, the window opens
            is_restored = False
            self._report_error(f"{type(error).__name__}: {error}")
        if not is_restored:
            bench.reset_layout()
            message = _("Can't restore the layout “{name}”; using its default.")
            self._report_error(message.format(name=name or _(layout_named(base).title)))

    def save(self, bench: Workbench, base: str) -> None:
        """Save the arrangement of a workbench for its current layout."""
        name = self.custom_name(base)
        self._state.save_layouts({CUSTOM_PREFIX + name if name else base: {**bench.save(), "base": base}})

    def switch(self, bench: Workbench, base: str, name: str) -> None:
        """Save the current layout of a workbench and switch to another one.

        Args:
            bench: Workbench.
            base: Name of its built-in layout.
            name: Name of the custom layout to show, or "" for the built-in one.
        """
        if name == self.custom_name(base):
            return
        self.save(bench, base)
        self._set_current(base, name)
        self.restore(bench, base)

    def save_as(self, bench: Workbench, base: str, name: str) -> bool:
        """Save the current arrangement as a new custom layout and switch to it.

        The saved arrangement of the previous layout isn't changed.

        Returns:
            False if the layout can't be saved and exists only until Studio closes.
        """
        is_saved = self._state.save_layouts({CUSTOM_PREFIX + name.strip(): {**bench.save(), "base": base}})
        self._set_current(base, name.strip())
        return is_saved

    def can_restore(self, bench: Workbench, base: str, saved: Mapping[str, object]) -> bool:
        """Return True if a workbench can restore an imported arrangement.

        The arrangement is restored temporarily; afterwards the workbench is as before.
        """
        self.save(bench, base)
        try:
            return bench.restore(saved)
        except Exception as error:  # noqa: BLE001  whatever was in the file, the window stays
            self._report_error(f"{type(error).__name__}: {error}")
            return False
        finally:
            self.restore(bench, base)

    def import_layout(self, name: str, base: str, saved: Mapping[str, object]) -> tuple[str, bool]:
        """Save an imported arrangement as a custom layout.

        Returns:
            The name of the layout, with a number appended if the name was taken or invalid, and True if
            the layout was saved.
        """
        name = name.strip()[:MAX_NAME_LENGTH].strip()
        free_name, number = name, 2
        while self.rejection_reason(free_name):
            suffix = f" {number}"
            free_name, number = f"{name[: MAX_NAME_LENGTH - len(suffix)]}{suffix}", number + 1
        return free_name, self._state.save_layouts({CUSTOM_PREFIX + free_name: {**saved, "base": base}})

    def rename(self, old: str, new: str) -> None:
        """Rename a custom layout. Has no effect if there is no layout with the old name."""
        layout = self.named(old)
        if layout is None or new.strip() == old:
            return
        is_current = self.custom_name(layout.base) == old
        self._state.save_layouts({CUSTOM_PREFIX + new.strip(): self._state.layout_state(CUSTOM_PREFIX + old)})
        self._state.delete_layout(CUSTOM_PREFIX + old)
        if is_current:
            self._set_current(layout.base, new.strip())

    def delete(self, bench: Workbench | None, name: str) -> tuple[bool, Callable[[], None]]:
        """Delete a custom layout and show the built-in layout in its place.

        Args:
            bench: Workbench that shows the layout, or None.
            name: Name of the layout.

        Returns:
            True if the deletion was saved or there is no such layout, and a function that undoes the
            deletion.
        """
        layout = self.named(name)
        if layout is None:
            return True, lambda: None
        base, is_current = layout.base, self.custom_name(layout.base) == name
        if is_current and bench is not None:
            self.switch(bench, base, "")
        saved = dict(self._state.layout_state(CUSTOM_PREFIX + name))
        is_saved = self._state.delete_layout(CUSTOM_PREFIX + name)

        def undo() -> None:
            self._state.save_layouts({CUSTOM_PREFIX + name: saved})
            if is_current and bench is not None:
                self.switch(bench, base, name)

        return is_saved, undo

    def _set_current(self, base: str, name: str) -> None:
        self._current[base] = name
        self._state.save_selected_layout(base, name)
