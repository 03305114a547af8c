"""Actions on an image, shared by the title bar, menus and keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction

from app.ui.pictures.zoom import STEP, ZoomablePicture
from app.ui.theme.theme import Theme
from nep.i18n import _, lazy


@dataclass(frozen=True)
class PictureRow:
    """Definition of an action.

    The first key is shown in menus; `above` adds a separator before the action.
    """

    name: str
    words: str
    keys: tuple[str, ...]
    icon: str | None = None
    above: bool = False
    check: bool = False


ROWS: tuple[PictureRow, ...] = (
    PictureRow("larger", lazy("Zoom in"), ("+", "Ctrl++"), "zoom-in"),
    PictureRow("smaller", lazy("Zoom out"), ("-", "Ctrl+-"), "zoom-out"),
    PictureRow("fit", lazy("Fit image"), ("0", "Ctrl+0"), "maximize"),
    PictureRow("exact", lazy("Actual size"), ("1",)),
    PictureRow("right", lazy("Rotate right"), ("R",), "rotate-cw", above=True),
    PictureRow("left", lazy("Rotate left"), ("Shift+R",), "rotate-ccw"),
    PictureRow("across", lazy("Flip horizontally"), ("H",), "move-horizontal", check=True),
    PictureRow("down", lazy("Flip vertically"), ("V",), "arrow-up-down", check=True),
    PictureRow("freeze", lazy("Freeze this image"), ("Space",), "snowflake", above=True, check=True),
    PictureRow("save", lazy("Save as PNG"), ("S",), "download"),
    PictureRow("copy", lazy("Copy the picture"), ("Ctrl+C",), "copy"),
    PictureRow(
        "point", lazy("Publish a point on click"), ("P",), "mouse-pointer-click", above=True, check=True
    ),
)


class PictureActions(QObject):
    """QActions of `ROWS` for one view; `own` implements those that `PictureView` lacks."""

    def __init__(self, theme: Theme, view: ZoomablePicture, own: Mapping[str, Callable[[], object]]) -> None:
        super().__init__(view)
        self._view = view
        does: dict[str, Callable[[], object]] = {
            "larger": lambda: view.zoom_by(STEP),
            "smaller": lambda: view.zoom_by(1 / STEP),
            "fit": view.show_whole,
            "exact": view.show_exact,
            "right": lambda: self._turn(90),
            "left": lambda: self._turn(-90),
            "across": lambda: self._flip(across=True),
            "down": lambda: self._flip(across=False),
            **own,
        }
        self._by_name: dict[str, QAction] = {}
        self._by_key: dict[str, QAction] = {}
        self._listed: list[QAction] = []  # with separators
        for row in ROWS:
            action = QAction(f"{_(row.words)}\t{row.keys[0]}", view)
            if row.icon is not None:
                action.setIcon(theme.icon(row.icon))
            action.setCheckable(row.check)
            action.triggered.connect(lambda _on=False, do=does[row.name]: do())
            self._by_name[row.name] = action
            if row.above:
                line = QAction(self)
                line.setSeparator(True)
                self._listed.append(line)
            self._listed.append(action)
            self._by_key.update(dict.fromkeys(row.keys, action))
        view.keys = frozenset(self._by_key)
        view.key_pressed.connect(self._key)
        view.place_changed.connect(self.show_checks)

    def __getitem__(self, name: str) -> QAction:
        return self._by_name[name]

    def listed(self) -> list[QAction]:
        """Return all actions with separators, for a menu."""
        return list(self._listed)

    def set_enabled(self, there: bool) -> None:
        """Enable the actions if `there` is True (an image is shown), else disable them."""
        for action in self._by_name.values():
            action.setEnabled(there)

    def show_checks(self) -> None:
        """Check the flip actions that are active."""
        self["across"].setChecked(self._view.place.flipped_across)
        self["down"].setChecked(self._view.place.flipped_down)

    def _key(self, name: str) -> None:
        self._by_key[name].trigger()

    def _turn(self, degrees: int) -> None:
        self._view.place.turn(degrees)
        self._view.told()

    def _flip(self, *, across: bool) -> None:
        self._view.place.flip(across=across)
        self._view.told()
