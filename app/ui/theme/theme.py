"""Theme of Studio: colours, sizes, durations and fonts by the name of their role.

`Theme` loads the design tokens and creates the palette, the style sheet and the values for the block
editor. Colours of the window are defined nowhere else (drawings of robots and marks in images have their
own); painters call, for example, ``theme.colour("accent")``. After a change, all windows are repainted
immediately.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

from PySide6.QtCore import QObject, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QGuiApplication, QIcon, QPalette, QStyleHints
from PySide6.QtWidgets import QApplication, QStyleFactory

from app.core.storage.settings import Mode, Preference
from app.ui.theme import fonts, style_sheet, system
from app.ui.theme import tokens as theme_tokens
from app.ui.theme.icons import IconEngine
from app.ui.theme.tokens import Status, Tokens

MONO_KINDS = frozenset({"code", "mono"})
DISPLAY_SPACING_EM = -0.02
TEXT_PERCENT_RANGE = (100, 200)
HC_STRONG_ROLES = frozenset({"border", "borderStrong", "okBorder", "warnBorder", "errorBorder"})
HC_FLAT_ROLES = ("okTint", "warnTint", "errorTint", "infoTint", "accentTint", "changedTint")
PALETTE_ROLES: Mapping[QPalette.ColorRole, str] = {
    QPalette.ColorRole.Window: "window",
    QPalette.ColorRole.WindowText: "text",
    QPalette.ColorRole.Text: "text",
    QPalette.ColorRole.ButtonText: "text",
    QPalette.ColorRole.Base: "panel",
    QPalette.ColorRole.AlternateBase: "sunken",
    QPalette.ColorRole.Button: "panel",
    QPalette.ColorRole.Mid: "border",
    QPalette.ColorRole.Midlight: "border",
    QPalette.ColorRole.Dark: "controlBorder",
    QPalette.ColorRole.Light: "raised",
    QPalette.ColorRole.Shadow: "borderStrong",
    QPalette.ColorRole.Highlight: "selected",
    QPalette.ColorRole.HighlightedText: "selectedText",
    QPalette.ColorRole.Accent: "accent",
    QPalette.ColorRole.Link: "accentText",
    QPalette.ColorRole.LinkVisited: "accentText",
    QPalette.ColorRole.ToolTipBase: "tooltip",
    QPalette.ColorRole.ToolTipText: "tooltipText",
    QPalette.ColorRole.PlaceholderText: "textTertiary",
}
DISABLED_ROLES = (QPalette.ColorRole.Text, QPalette.ColorRole.WindowText, QPalette.ColorRole.ButtonText)


STYLED_PROPERTY = "isFusion"
"""Application property that is True once the style was set, which can't be queried under a style sheet."""


class Theme(QObject):
    """Colours, sizes, fonts and icons of the current mode. `changed` is emitted after every change."""

    changed = Signal()

    def __init__(
        self, mode: Mode = "light", tokens: Tokens | None = None, hints: QStyleHints | None = None
    ) -> None:
        # The mode "system" follows `hints`, by default those of the application.
        super().__init__()
        self._tokens = tokens if tokens is not None else theme_tokens.load()
        self._hints = hints if hints is not None else QGuiApplication.styleHints()
        self._mode: Mode = mode
        self._text_percent = TEXT_PERCENT_RANGE[0]
        self.motion: Preference = "off"  # "on" means reduced motion
        self.contrast: Preference = "off"  # "on" means high contrast
        self.is_motion_reduced = self.is_high_contrast = False
        self._is_dark = self._resolve_dark()
        self._icons: dict[tuple[str, str, str, bool, bool], QIcon] = {}
        self._fonts: dict[str, QFont] = {}
        self._hints.colorSchemeChanged.connect(self._system_changed)
        system.on_contrast_changed(self._hints, lambda: self.set_contrast(self.contrast))

    # -- mode -------------------------------------------------------------------------------------

    @property
    def mode(self) -> Mode:
        """Selected mode: "light", "dark", or "system" to follow the system."""
        return self._mode

    @property
    def is_dark(self) -> bool:
        """True if the dark colours are in use."""
        return self._is_dark

    @property
    def tokens(self) -> Mapping[str, object]:
        """Design tokens, as parsed from their file."""
        return self._tokens.raw

    def set_mode(self, mode: Mode) -> None:
        """Select light or dark colours, or follow the system."""
        self._mode = mode
        self._refresh()

    def apply_settings(self, mode: Mode, text_percent: int, motion: Preference, contrast: Preference) -> None:
        """Apply all settings in one update.

        Args:
            mode: "light", "dark" or "system".
            text_percent: Text size in percent, clamped to 100 to 200.
            motion: Reduced motion: "on", "off" or "system".
            contrast: High contrast: "on", "off" or "system".
        """
        self._mode, self.contrast = mode, contrast
        self.is_high_contrast = self._resolve_contrast()
        self._text_percent = min(max(text_percent, TEXT_PERCENT_RANGE[0]), TEXT_PERCENT_RANGE[1])
        self._fonts.clear()
        self.set_motion(motion)
        self._refresh()

    def set_text_percent(self, percent: int) -> None:
        """Set the text size in percent, clamped to 100 to 200."""
        self._text_percent = min(max(percent, TEXT_PERCENT_RANGE[0]), TEXT_PERCENT_RANGE[1])
        self._fonts.clear()
        self.apply()

    def set_motion(self, preference: Preference) -> None:
        """Set reduced motion: "on", "off", or "system" to follow the system."""
        self.motion = preference
        self.is_motion_reduced = preference == "on" or (
            preference == "system" and system.prefers_reduced_motion()
        )
        self.changed.emit()

    def set_contrast(self, preference: Preference) -> None:
        """Set high contrast: "on", "off", or "system" to follow the system.

        High contrast has strong borders and no tinted backgrounds.
        """
        self.contrast = preference
        if self._resolve_contrast() != self.is_high_contrast:
            self.is_high_contrast = not self.is_high_contrast
            self.apply()
        else:
            self.changed.emit()

    def _resolve_contrast(self) -> bool:
        is_requested = self.contrast == "system" and system.prefers_contrast(self._hints)
        return self.contrast == "on" or is_requested

    @property
    def text_percent(self) -> int:
        """Text size in percent, 100 to 200."""
        return self._text_percent

    def apply(self) -> None:
        """Apply style, palette, font and style sheet to the application, and emit `changed`."""
        application = QApplication.instance()
        if isinstance(application, QApplication):
            # Each of these visits all widgets, even if nothing changes.
            if application.property(STYLED_PROPERTY) is None:
                application.setStyle(QStyleFactory.create("Fusion"))
                application.setProperty(STYLED_PROPERTY, True)
            palette, font, sheet = self.palette(), self.font("body"), self.style_sheet()
            if application.palette() != palette:
                application.setPalette(palette)
            if application.font() != font:
                application.setFont(font)
            if application.styleSheet() != sheet:
                application.setStyleSheet(sheet)
        self.changed.emit()

    def _resolve_dark(self) -> bool:
        if self._mode == "system":
            return self._hints.colorScheme() == Qt.ColorScheme.Dark
        return self._mode == "dark"

    def _system_changed(self) -> None:
        if self._mode == "system":
            self._refresh()

    def _refresh(self) -> None:
        self._is_dark = self._resolve_dark()
        self.apply()

    # -- colours ----------------------------------------------------------------------------------

    @property
    def _colour_scheme(self) -> str:
        return "dark" if self._is_dark else "light"

    def hex(self, role: str) -> str:
        """Return the colour of a role as ``#RRGGBB`` or ``#RRGGBBAA``.

        Raises:
            KeyError: The role is unknown.
        """
        if self.is_high_contrast:
            if role in HC_STRONG_ROLES:
                role = "controlBorder"
            elif role in HC_FLAT_ROLES:
                role = "panel"
        return self._tokens.colours[self._colour_scheme][role]

    def colour(self, role: str) -> QColor:
        """Return the colour of a role.

        Raises:
            KeyError: The role is unknown.
        """
        return qt_colour(self.hex(role))

    def series(self, index: int) -> QColor:
        """Return the colour of the curve with this index; the colours repeat."""
        colours = self._tokens.series[self._colour_scheme]
        return QColor(colours[index % len(colours)])

    def block_colour(self, category: str, part: str = "primary") -> QColor:
        """Return a colour of a block category; an unknown category has the colours of "values".

        Args:
            category: Name of the category.
            part: "primary", "secondary" or "tertiary".
        """
        block = self._tokens.blocks.get(category, self._tokens.blocks["values"])
        return QColor(block[self._colour_scheme][part])

    def block_text(self, category: str) -> QColor:
        """Return the colour of text and icons on blocks of a category, by default that of "values"."""
        return QColor(self._tokens.block_text.get(category, self._tokens.block_text["values"]))

    def block_icon(self, category: str) -> str:
        """Return the name of the icon of a block category; that of "values" for an unknown category."""
        return self._tokens.block_icons.get(category, self._tokens.block_icons["values"])

    def status(self, name: str) -> Status:
        """Return colours and icon of a status.

        Args:
            name: "ok", "warn", "error", "info", "off", "running" or "recording".

        Raises:
            KeyError: The status is unknown.
        """
        return self._tokens.status[name]

    def palette(self) -> QPalette:
        """Return the palette for widgets that are painted by Qt."""
        return _palette(self.colour)

    def style_sheet(self) -> str:
        """Return the application's style sheet."""
        return style_sheet.build(self)

    # -- sizes and durations ----------------------------------------------------------------------

    def size(self, *path: str) -> int:
        """Return a length in px by its path in the tokens, such as ``size("row", "compact")``.

        Raises:
            KeyError: There is no such length.
        """
        value: object = self._tokens.sizes
        for step in path:
            if not isinstance(value, Mapping):
                raise KeyError("/".join(path))
            value = value[step]
        if not isinstance(value, int | float):
            raise KeyError("/".join(path))
        return round(value)

    def size_pair(self, *path: str) -> QSize:
        """Return a width and height in px by path in the tokens, as in ``size_pair("stop", "runBar")``.

        Raises:
            KeyError: There is no such pair.
        """
        value: object = self._tokens.sizes
        for step in path:
            value = value[step] if isinstance(value, Mapping) else None
        if not isinstance(value, list):
            raise KeyError("/".join(path))
        return QSize(int(value[0]), int(value[1]))

    def radius(self, name: str) -> int:
        """Return a corner radius in px by name, such as "small", "control" or "panel".

        Raises:
            KeyError: The name is unknown.
        """
        return self._tokens.radii[name]

    def duration(self, name: str) -> int:
        """Return a duration in ms by name.

        If motion is reduced, durations of animations are 0; the display times of messages are
        unchanged.
        """
        if self.is_motion_reduced and not name.endswith("Shown"):
            return 0
        return self._tokens.motion_ms[name]

    # -- fonts and icons --------------------------------------------------------------------------

    def scaled(self, pixels: float) -> float:
        """Scale a length, given in px at 100 % text size, to the current text size."""
        return pixels * self._text_percent / 100

    def font(self, kind: str) -> QFont:
        """Return the font for a kind of text, such as "body"; "mono" is the body font in JetBrains Mono."""
        if kind not in self._fonts:
            text = self._tokens.texts["body" if kind == "mono" else kind]
            family = self._tokens.families["mono" if kind in MONO_KINDS else "text"]
            self._fonts[kind] = fonts.make_font(
                (family, *self._tokens.fallback),
                self.scaled(text.size_px),
                text.weight,
                spacing_em=DISPLAY_SPACING_EM if kind in {"display", "show"} else 0.0,
            )
        return QFont(self._fonts[kind])

    def text_kinds(self) -> Mapping[str, theme_tokens.TextKind]:
        """Return all kinds of text by name."""
        return self._tokens.texts

    def family(self, kind: Literal["text", "mono"]) -> str:
        """Return the font family for text or code."""
        return self._tokens.families[kind]

    def icon_name(self, use: str) -> str:
        """Return the name of the icon for a use, such as "play" for "run".

        Raises:
            KeyError: The use is unknown.
        """
        return self._tokens.icons[use]

    def icon(
        self,
        name: str,
        role: str = "textSecondary",
        *,
        active_role: str = "text",
        is_filled: bool = False,
        is_right: bool = False,
    ) -> QIcon:
        """Return an icon that follows changes of the theme.

        Args:
            name: Name of the icon.
            role: Colour role.
            active_role: Colour role while the icon is active, for example hovered.
            is_filled: True to fill the shape with the colour.
            is_right: True to paint the icon on the right in a size that is wider than high.
        """
        key = (name, role, active_role, is_filled, is_right)
        if key not in self._icons:

            def colour(mode: QIcon.Mode, _state: QIcon.State) -> QColor:
                if mode == QIcon.Mode.Disabled:
                    return self.colour("textDisabled")
                return self.colour(active_role if mode == QIcon.Mode.Active else role)

            self._icons[key] = QIcon(IconEngine(name, colour, is_filled=is_filled, is_right=is_right))
        return self._icons[key]

    # -- block editor -----------------------------------------------------------------------------

    def blockly_tokens(self) -> dict[str, object]:
        """Return the colours and other values of the current mode for the page of the block editor."""
        return theme_tokens.tokens_for_page(
            self._tokens,
            self.hex,
            is_dark=self._is_dark,
            is_motion_reduced=self.is_motion_reduced,
            text_percent=self._text_percent,
        )


def _palette(colour: Callable[[str], QColor]) -> QPalette:
    palette = QPalette()
    for role, name in PALETTE_ROLES.items():
        palette.setColor(role, colour(name))
    for role in DISABLED_ROLES:
        palette.setColor(QPalette.ColorGroup.Disabled, role, colour("textDisabled"))
    return palette


def qt_colour(text: str) -> QColor:
    """Convert a colour such as ``#RRGGBB`` or ``#RRGGBBAA`` to a QColor.

    Qt itself expects alpha at the start.
    """
    if len(text) == len("#RRGGBBAA"):
        colour = QColor(text[:7])
        colour.setAlpha(int(text[7:], 16))
        return colour
    return QColor(text)
