"""Show common widgets in the light and dark theme, or save an image of them.

Usage: python tools/gallery.py [PICTURE.png] [--text PERCENT]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from PySide6.QtCore import Qt
from PySide6.QtGui import QColor, QPainter, QPixmap
from PySide6.QtWidgets import QApplication, QHBoxLayout, QVBoxLayout, QWidget

from app.ui.panels.robots.robots.controls.colour import ColourSwatches
from app.ui.shell.bars.banner import Banner
from app.ui.theme import fonts
from app.ui.theme.theme import Theme
from app.ui.widgets import (
    Button,
    Card,
    Chip,
    ComboBox,
    EmptyAction,
    EmptyState,
    IconButton,
    RunButton,
    SearchField,
    Segments,
    SliderWithUnit,
    Sparkline,
    StatusItem,
    StopButton,
    Switch,
    ValueBar,
    label,
)

WAVE = (1.0, 3.0, 2.0, 5.0, 4.0, 6.0, 2.0, 3.0, 1.0, 4.0)


def row(*widgets: QWidget) -> QWidget:
    """Create a widget that shows the given widgets side by side."""
    container = QWidget()
    line = QHBoxLayout(container)
    line.setContentsMargins(0, 0, 0, 0)
    line.setSpacing(8)
    for widget in widgets:
        line.addWidget(widget)
    line.addStretch(1)
    return container


def _buttons(theme: Theme) -> list[QWidget]:
    run = RunButton(theme, "Run", "play", longest_text="Resume")
    run.set_filled(True)
    idle = RunButton(theme, "Pause", "pause")
    idle.setEnabled(False)
    stopping = StopButton(theme)
    stopping.show_state("Stopping", has_ring=True)
    outlined = StopButton(theme, "appBar")
    outlined.show_state("Stop", is_filled=False)
    stop_again = StopButton(theme, "toolBar")
    stop_again.show_state("Stop again")
    return [
        row(run, idle, RunButton(theme, "Step", "step-forward"), StopButton(theme), stopping),
        row(stop_again, outlined, StopButton(theme, "toolBar")),
        row(
            Button(theme, "Use the virtual robot", "bot", kind="primary", size="large"),
            Button(theme, "New behaviour", size="large"),
            Button(theme, "Try", "play", size="form"),
            Button(theme, "Connect NAO"),
            Button(theme, "Small", "copy", size="small"),
            Button(theme, "Ghost", kind="ghost"),
            IconButton(theme, "ellipsis", "More"),
            IconButton(theme, "snowflake", "Freeze", "Space", checkable=True),
        ),
    ]


def _fields(theme: Theme) -> list[QWidget]:
    layouts: list[tuple[str, str, str | None]] = [
        ("b", "Behaviour", "blocks"), ("d", "Developer", "activity"),
    ]  # fmt: skip
    languages: list[tuple[str, str, str | None]] = [
        ("en", "English", None), ("fr", "French", None), ("ja", "Japanese", None),
    ]  # fmt: skip
    invalid = SliderWithUnit(theme, 0, 1, step=0.05, value=0.5, unit="m", name="Distance")
    invalid.field.setText("2.4")
    invalid.field.editingFinished.emit()
    return [
        row(
            *(Chip(theme, name, name) for name in ("ok", "warn", "error", "info", "off", "running")),
            Chip(theme, "new", "info", ""),
        ),
        row(Segments(theme, layouts), Segments(theme, languages, check=True, size="form")),
        row(
            SearchField(theme, "Filter", "/"),
            ComboBox(theme, [("a", "Live network")]),
            Switch(theme, "loud", True),
        ),
        SliderWithUnit(theme, 0, 100, value=60, unit="%", name="Volume"),
        invalid,
        ColourSwatches(theme, "#3ab7ff"),
    ]


def _status_widgets(theme: Theme) -> list[QWidget]:
    spark = Sparkline(theme)
    spark.set_values(WAVE)
    bar = ValueBar(theme, 0.6)
    bar.setFixedWidth(200)
    banner = Banner(theme)
    banner.show_text(
        "error", "The camera of Pepper has been silent for 4 s.", "The behaviour is waiting.", "Show", 2
    )
    card = Card()
    layout = QVBoxLayout(card)
    layout.addWidget(label("Create a behaviour", "heading"))
    layout.addWidget(label("Start with an empty page.", "bodyLarge", role="textSecondary"))
    empty = EmptyState(
        theme,
        "radio-tower",
        "No master is running",
        "A master lets programs find each other. Start one here, or choose a computer that has one.",
        [EmptyAction("Start a master here", print, "play", is_primary=True), EmptyAction("Choose", print)],
    )
    status = StatusItem(theme, "circle-check", "Master 127.0.0.1:7780", "ok")
    lost = StatusItem(theme, "triangle-alert", "12 lost in 30 s", "warn")
    return [row(spark, bar, status, lost), banner, card, empty]


def page(theme: Theme) -> QWidget:
    """Create a page with common widgets."""
    container = QWidget()
    container.setAutoFillBackground(True)
    column = QVBoxLayout(container)
    column.setSpacing(12)
    column.addWidget(label("What would you like to do?", "display"))
    for widget in (*_buttons(theme), *_fields(theme), *_status_widgets(theme)):
        column.addWidget(widget)
    return container


def render_themes(percent: int) -> QPixmap:
    """Render the page in both themes side by side, with the text size in percent."""
    shots = []
    for mode in ("light", "dark"):
        theme = Theme("light" if mode == "light" else "dark")
        theme.set_text_percent(percent)
        widget = page(theme)
        widget.resize(820, 980)
        widget.setAttribute(Qt.WidgetAttribute.WA_DontShowOnScreen)
        widget.show()
        shots.append(widget.grab())
        widget.close()
    combined = QPixmap(sum(shot.width() for shot in shots), max(shot.height() for shot in shots))
    combined.fill(QColor(Qt.GlobalColor.gray))
    painter = QPainter(combined)
    left = 0
    for shot in shots:
        painter.drawPixmap(left, 0, shot)
        left += shot.width()
    painter.end()
    return combined


def main() -> int:
    """Show the gallery or save its image; return 1 if the image can't be saved."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", nargs="?", type=Path)
    parser.add_argument("--text", type=int, default=100)
    options = parser.parse_args()
    application = QApplication(sys.argv[:1])
    fonts.load()
    if options.picture is not None:
        return 0 if render_themes(options.text).save(str(options.picture)) else 1
    theme = Theme("system")
    theme.apply()
    gallery = page(theme)
    gallery.show()
    return application.exec()


if __name__ == "__main__":
    sys.exit(main())
