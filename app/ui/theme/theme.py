"""The look of Studio: every colour, size, duration and font by the name of its role.

`Theme` reads the design tokens and makes a palette, one style sheet and the tokens of the block editor. No
other module writes a colour down; painters ask ``theme.colour("accent")``. A change repaints at once.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal, get_args

from PySide6.QtCore import QObject, QSize, Qt, Signal
from PySide6.QtGui import QColor, QFont, QGuiApplication, QIcon, QPalette, QStyleHints
from PySide6.QtWidgets import QApplication, QStyleFactory

from app.ui.theme import fonts, style_sheet, system
from app.ui.theme import tokens as theme_tokens
from app.ui.theme.icons import IconEngine
from app.ui.theme.system import Preference
from app.ui.theme.tokens import Status, Tokens

Mode = Literal["light", "dark", "system"]
MODES: tuple[Mode, ...] = get_args(Mode)
MONO_KINDS = frozenset({"code", "mono"})
DISPLAY_SPACING_EM = -0.02
TEXT_PERCENT = (100, 200)
STRONGER = frozenset({"border", "borderStrong", "okBorder", "warnBorder", "errorBorder"})
DEPRIVED_OF_TINT = ("okTint", "warnTint", "errorTint", "infoTint", "accentTint", "changedTint")
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


STYLED = "isFusion"
"""What the application remembers: with a style sheet it does not tell the style that is below."""


class Theme(QObject):
    """Colours, sizes, fonts and icons of the chosen mode; `changed` when any of them did."""

    changed = Signal()

    def __init__(
        self, mode: Mode = "light", tokens: Tokens | None = None, hints: QStyleHints | None = None
    ) -> None:
        """A theme in ``mode``; ``system`` follows ``hints`` (the application's) while it lives."""
        super().__init__()
        self._tokens = tokens if tokens is not None else theme_tokens.load()
        self._hints = hints if hints is not None else QGuiApplication.styleHints()
        self._mode: Mode = mode
        self._text_percent = TEXT_PERCENT[0]
        self.motion: Preference = "off"  # less of it
        self.contrast: Preference = "off"  # more of it
        self.reduced_motion = self.high_contrast = False
        self._dark = self._wanted_dark()
        self._icons: dict[tuple[str, str, str], QIcon] = {}
        self._fonts: dict[str, QFont] = {}
        self._hints.colorSchemeChanged.connect(self._system_changed)
        system.on_contrast(self._hints, lambda: self.set_contrast(self.contrast))

    # -- the mode ---------------------------------------------------------------------------------

    @property
    def mode(self) -> Mode:
        """What was chosen: "light", "dark" or "system"."""
        return self._mode

    @property
    def dark(self) -> bool:
        """Whether the colours are the dark ones now."""
        return self._dark

    @property
    def tokens(self) -> Mapping[str, object]:
        """The design tokens as they stand in their file."""
        return self._tokens.raw

    def set_mode(self, mode: Mode) -> None:
        """Choose light, dark or the system's colours; everything repaints at once."""
        self._mode = mode
        self._refresh()

    def begin(self, mode: Mode, text_percent: int, motion: Preference, contrast: Preference) -> None:
        """Take over everything that was chosen before, and apply it once."""
        self._mode, self.contrast = mode, contrast
        self.high_contrast = self._wanted_contrast()
        self._text_percent = min(max(text_percent, TEXT_PERCENT[0]), TEXT_PERCENT[1])
        self._fonts.clear()
        self.set_motion(motion)
        self._refresh()

    def set_text_percent(self, percent: int) -> None:
        """Text and what is measured by it, 100 to 200 per cent."""
        self._text_percent = min(max(percent, TEXT_PERCENT[0]), TEXT_PERCENT[1])
        self._fonts.clear()
        self.apply()

    def set_motion(self, wish: Preference) -> None:
        """Whether nothing fades, glides or breathes: "on" is less motion, "system" as the system says."""
        self.motion = wish
        self.reduced_motion = wish == "on" or (wish == "system" and system.wants_less_motion())
        self.changed.emit()

    def set_contrast(self, wish: Preference) -> None:
        """Whether edges are strong and tints are off: "on", "off", or as the system says."""
        self.contrast = wish
        if self._wanted_contrast() != self.high_contrast:
            self.high_contrast = not self.high_contrast
            self.apply()
        else:
            self.changed.emit()

    def _wanted_contrast(self) -> bool:
        asked = self.contrast == "system" and system.wants_contrast(self._hints)
        return self.contrast == "on" or asked

    @property
    def text_percent(self) -> int:
        """The size of text, 100 to 200."""
        return self._text_percent

    def apply(self) -> None:
        """Give the application this theme's style, palette, style sheet and font, then tell everyone."""
        application = QApplication.instance()
        if isinstance(application, QApplication):
            # Each of these goes through all widgets, also when it brings nothing new.
            if application.property(STYLED) is None:
                application.setStyle(QStyleFactory.create("Fusion"))
                application.setProperty(STYLED, True)
            palette, font, sheet = self.palette(), self.font("body"), self.style_sheet()
            if application.palette() != palette:
                application.setPalette(palette)
            if application.font() != font:
                application.setFont(font)
            if application.styleSheet() != sheet:
                application.setStyleSheet(sheet)
        self.changed.emit()

    def _wanted_dark(self) -> bool:
        if self._mode == "system":
            return self._hints.colorScheme() == Qt.ColorScheme.Dark
        return self._mode == "dark"

    def _system_changed(self) -> None:
        if self._mode == "system":
            self._refresh()

    def _refresh(self) -> None:
        self._dark = self._wanted_dark()
        self.apply()

    # -- colours ----------------------------------------------------------------------------------

    @property
    def _scheme(self) -> str:
        return "dark" if self._dark else "light"

    def hex(self, role: str) -> str:
        """A role's colour as the tokens write it; KeyError when there is no such role."""
        if self.high_contrast:
            if role in STRONGER:
                role = "controlBorder"
            elif role in DEPRIVED_OF_TINT:
                role = "panel"
        return self._tokens.colours[self._scheme][role]

    def colour(self, role: str) -> QColor:
        """The colour of a role; KeyError when the tokens have no such role."""
        return qt_colour(self.hex(role))

    def series(self, index: int) -> QColor:
        """The colour of a curve; they repeat after the last."""
        colours = self._tokens.series[self._scheme]
        return QColor(colours[index % len(colours)])

    def block_colour(self, category: str, part: str = "primary") -> QColor:
        """A block category's "primary", "secondary" or "tertiary" colour; unknown ones look like values."""
        block = self._tokens.blocks.get(category, self._tokens.blocks["values"])
        return QColor(block[self._scheme][part])

    def block_text(self, category: str) -> QColor:
        """The colour of words and icons on a block."""
        return QColor(self._tokens.block_text.get(category, self._tokens.block_text["values"]))

    def block_icon(self, category: str) -> str:
        """The icon of a block category."""
        return self._tokens.block_icons.get(category, self._tokens.block_icons["values"])

    def status(self, name: str) -> Status:
        """How "ok", "warn", "error", "info", "off", "running" or "recording" looks."""
        return self._tokens.status[name]

    def palette(self) -> QPalette:
        """The palette of the widgets that Qt paints, in this mode."""
        return _palette(self.colour)

    def style_sheet(self) -> str:
        """The one style sheet, for the application."""
        return style_sheet.build(self)

    # -- sizes and times --------------------------------------------------------------------------

    def size(self, *path: str) -> int:
        """A length in pixels, such as ``size("row", "compact")``; KeyError when it is not in the tokens."""
        value: object = self._tokens.sizes
        for step in path:
            if not isinstance(value, Mapping):
                raise KeyError("/".join(path))
            value = value[step]
        if not isinstance(value, int | float):
            raise KeyError("/".join(path))
        return round(value)

    def pair(self, *path: str) -> QSize:
        """A width and height, such as ``pair("stop", "runBar")``."""
        value: object = self._tokens.sizes
        for step in path:
            value = value[step] if isinstance(value, Mapping) else None
        if not isinstance(value, list):
            raise KeyError("/".join(path))
        return QSize(int(value[0]), int(value[1]))

    def radius(self, name: str) -> int:
        """A corner's radius in pixels."""
        return self._tokens.radii[name]

    def duration(self, name: str) -> int:
        """A duration in ms; 0 under reduced motion, except how long something is shown."""
        if self.reduced_motion and not name.endswith("Shown"):
            return 0
        return self._tokens.motion_ms[name]

    # -- fonts and icons --------------------------------------------------------------------------

    def scaled(self, pixels: float) -> float:
        """Pixels that grow with the text."""
        return pixels * self._text_percent / 100

    def font(self, kind: str) -> QFont:
        """The font of a kind of text in the tokens, or "mono" (body in JetBrains Mono)."""
        if kind not in self._fonts:
            text = self._tokens.texts["body" if kind == "mono" else kind]
            family = self._tokens.families["mono" if kind in MONO_KINDS else "text"]
            self._fonts[kind] = fonts.make(
                (family, *self._tokens.fallback),
                self.scaled(text.size_px),
                text.weight,
                spacing_em=DISPLAY_SPACING_EM if kind in {"display", "show"} else 0.0,
            )
        return QFont(self._fonts[kind])

    def text_kinds(self) -> Mapping[str, theme_tokens.TextKind]:
        """Every kind of text by name."""
        return self._tokens.texts

    def family(self, kind: Literal["text", "mono"]) -> str:
        """The family of text or of code."""
        return self._tokens.families[kind]

    def icon_name(self, use: str) -> str:
        """The icon of a meaning, such as "play" for "run"; KeyError when the design gives it none."""
        return self._tokens.icons[use]

    def icon(self, name: str, role: str = "textSecondary", *, active: str = "text") -> QIcon:
        """An icon in the colour of a role; it recolours itself when the theme changes."""
        key = (name, role, active)
        if key not in self._icons:

            def colour(mode: QIcon.Mode, _state: QIcon.State) -> QColor:
                if mode == QIcon.Mode.Disabled:
                    return self.colour("textDisabled")
                return self.colour(active if mode == QIcon.Mode.Active else role)

            self._icons[key] = QIcon(IconEngine(name, colour))
        return self._icons[key]

    # -- the block editor -------------------------------------------------------------------------

    def blockly_tokens(self) -> dict[str, object]:
        """What the page of the block editor needs: all roles and block colours of the mode that shows now."""
        return theme_tokens.tokens_for_page(
            self._tokens,
            self.hex,
            dark=self._dark,
            reduced_motion=self.reduced_motion,
            text_percent=self._text_percent,
        )


def _palette(colour: Callable[[str], QColor]) -> QPalette:
    """The palette; ``colour`` gives that of a role."""
    palette = QPalette()
    for role, name in PALETTE_ROLES.items():
        palette.setColor(role, colour(name))
    for role in DISABLED_ROLES:
        palette.setColor(QPalette.ColorGroup.Disabled, role, colour("textDisabled"))
    return palette


def qt_colour(text: str) -> QColor:
    """A QColor from a token; ``#RRGGBBAA`` has its alpha last, which Qt does not know."""
    if len(text) == len("#RRGGBBAA"):
        colour = QColor(text[:7])
        colour.setAlpha(int(text[7:], 16))
        return colour
    return QColor(text)
