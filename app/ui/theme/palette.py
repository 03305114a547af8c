"""Qt's own palette, filled with the roles of the theme, and tokens as Qt's colours."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from PySide6.QtGui import QColor, QPalette

ROLES: Mapping[QPalette.ColorRole, str] = {
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

DISABLED = (QPalette.ColorRole.Text, QPalette.ColorRole.WindowText, QPalette.ColorRole.ButtonText)


def build(colour: Callable[[str], QColor]) -> QPalette:
    """The palette; ``colour`` gives that of a role."""
    palette = QPalette()
    for role, name in ROLES.items():
        palette.setColor(role, colour(name))
    for role in DISABLED:
        palette.setColor(QPalette.ColorGroup.Disabled, role, colour("textDisabled"))
    return palette


def qt_colour(text: str) -> QColor:
    """A QColor from a token; ``#RRGGBBAA`` has its alpha last, which Qt does not know."""
    if len(text) == len("#RRGGBBAA"):
        colour = QColor(text[:7])
        colour.setAlpha(int(text[7:], 16))
        return colour
    return QColor(text)
