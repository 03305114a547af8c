"""Actions on an image, which are shared by the title bar, the menus and the keyboard."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction

from app.ui.pictures.zoom import ZOOM_STEP, ZoomablePicture
from app.ui.theme.theme import Theme
from nep.i18n import _, lazy


@dataclass(frozen=True)
class ImageActionSpec:
    """Definition of an action.

    Attributes:
        name: Id of the action.
        text: Text in menus.
        keys: Shortcut keys; menus show the first one.
        icon: Name of the icon, or None.
        has_separator: True for a separator before the action.
        is_checkable: True for a checkable action.
    """

    name: str
    text: str
    keys: tuple[str, ...]
    icon: str | None = None
    has_separator: bool = False
    is_checkable: bool = False


ACTION_SPECS: tuple[ImageActionSpec, ...] = (
    ImageActionSpec("larger", lazy("Zoom in"), ("+", "Ctrl++"), "zoom-in"),
    ImageActionSpec("smaller", lazy("Zoom out"), ("-", "Ctrl+-"), "zoom-out"),
    ImageActionSpec("fit", lazy("Fit image"), ("0", "Ctrl+0"), "maximize"),
    ImageActionSpec("exact", lazy("Actual size"), ("1",)),
    ImageActionSpec("right", lazy("Rotate right"), ("R",), "rotate-cw", has_separator=True),
    ImageActionSpec("left", lazy("Rotate left"), ("Shift+R",), "rotate-ccw"),
    ImageActionSpec("across", lazy("Flip horizontally"), ("H",), "move-horizontal", is_checkable=True),
    ImageActionSpec("down", lazy("Flip vertically"), ("V",), "arrow-up-down", is_checkable=True),
    ImageActionSpec(
        "freeze", lazy("Freeze this image"), ("Space",), "snowflake", has_separator=True, is_checkable=True
    ),
    ImageActionSpec("save", lazy("Save as PNG"), ("S",), "download"),
    ImageActionSpec("copy", lazy("Copy the image"), ("Ctrl+C",), "copy"),
    ImageActionSpec(
        "point",
        lazy("Publish a point on click"),
        ("P",),
        "mouse-pointer-click",
        has_separator=True,
        is_checkable=True,
    ),
)


class PictureActions(QObject):
    """QActions defined in `ACTION_SPECS`, for one image view.

    Args:
        view: Image view that the actions change.
        own_callbacks: Functions of the actions that `view` does not implement, by name.
    """

    def __init__(
        self, theme: Theme, view: ZoomablePicture, own_callbacks: Mapping[str, Callable[[], object]]
    ) -> None:
        super().__init__(view)
        self._view = view
        callbacks: dict[str, Callable[[], object]] = {
            "larger": lambda: view.zoom_by(ZOOM_STEP),
            "smaller": lambda: view.zoom_by(1 / ZOOM_STEP),
            "fit": view.fit_to_view,
            "exact": view.show_actual_size,
            "right": lambda: self._rotate(90),
            "left": lambda: self._rotate(-90),
            "across": lambda: self._flip(is_horizontal=True),
            "down": lambda: self._flip(is_horizontal=False),
            **own_callbacks,
        }
        self._by_name: dict[str, QAction] = {}
        self._by_key: dict[str, QAction] = {}
        self._menu_actions: list[QAction] = []  # with separators
        for spec in ACTION_SPECS:
            action = QAction(f"{_(spec.text)}\t{spec.keys[0]}", view)
            if spec.icon is not None:
                action.setIcon(theme.icon(spec.icon))
            action.setCheckable(spec.is_checkable)
            action.triggered.connect(lambda _on=False, callback=callbacks[spec.name]: callback())
            self._by_name[spec.name] = action
            if spec.has_separator:
                separator = QAction(self)
                separator.setSeparator(True)
                self._menu_actions.append(separator)
            self._menu_actions.append(action)
            self._by_key.update(dict.fromkeys(spec.keys, action))
        view.keys = frozenset(self._by_key)
        view.key_pressed.connect(self._trigger)
        view.placement_changed.connect(self.update_checks)

    def __getitem__(self, name: str) -> QAction:
        return self._by_name[name]

    def menu_actions(self) -> list[QAction]:
        """Return all actions with separators, for a menu."""
        return list(self._menu_actions)

    def set_enabled(self, has_image: bool) -> None:
        """Enable or disable all actions.

        Args:
            has_image: True if an image is shown.
        """
        for action in self._by_name.values():
            action.setEnabled(has_image)

    def update_checks(self) -> None:
        """Update the check marks of the flip actions."""
        self["across"].setChecked(self._view.placement.is_flipped_horizontally)
        self["down"].setChecked(self._view.placement.is_flipped_vertically)

    def _trigger(self, name: str) -> None:
        self._by_key[name].trigger()

    def _rotate(self, degrees: int) -> None:
        self._view.placement.rotate(degrees)
        self._view.notify_changed()

    def _flip(self, *, is_horizontal: bool) -> None:
        self._view.placement.flip(is_horizontal=is_horizontal)
        self._view.notify_changed()
