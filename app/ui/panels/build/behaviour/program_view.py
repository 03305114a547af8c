"""Read-only view of a behaviour's Python program with syntax highlighting."""

from __future__ import annotations

import keyword
import re

from PySide6.QtCore import QRegularExpression
from PySide6.QtGui import QSyntaxHighlighter, QTextCharFormat, QTextDocument
from PySide6.QtWidgets import QFrame, QPlainTextEdit

from app.ui.theme.theme import Theme
from app.ui.widgets.menus import FieldContextMenu
from nep.i18n import _

# The first rule that matches wins: strings and comments come before keywords.
_HIGHLIGHT_RULES: tuple[tuple[str, str], ...] = (
    ("ok", r"""[fFrRbB]{0,2}(?:\"(?:\\.|[^\"\\])*\"|'(?:\\.|[^'\\])*')"""),
    ("textTertiary", r"#[^\n]*"),
    ("changed", r"@[\w.]+"),
    ("accentText", rf"\b(?:{'|'.join(keyword.kwlist)})\b"),
    ("info", r"\b(?:def|class)\s+\w+"),
    ("warn", r"\b\d+(?:\.\d+)?\b"),
)


class _Highlighter(QSyntaxHighlighter):
    def __init__(self, document: QTextDocument, theme: Theme) -> None:
        super().__init__(document)
        self._theme = theme
        pattern = "|".join(f"(?P<r{index}>{rule})" for index, (_role, rule) in enumerate(_HIGHLIGHT_RULES))
        self._rules = re.compile(pattern)

    def highlightBlock(self, text: str) -> None:
        for match in self._rules.finditer(text):
            role = _HIGHLIGHT_RULES[int((match.lastgroup or "r0")[1:])][0]
            text_format = QTextCharFormat()
            text_format.setForeground(self._theme.colour(role))
            self.setFormat(match.start(), match.end() - match.start(), text_format)


class ProgramView(QPlainTextEdit):
    """Read-only view of a Python program with syntax highlighting in the colours of the theme."""

    def __init__(self, theme: Theme) -> None:
        super().__init__()
        self._theme = theme
        self.setReadOnly(True)
        self.setProperty("bare", "true")
        self.setFrameShape(QFrame.Shape.NoFrame)
        self.setLineWrapMode(QPlainTextEdit.LineWrapMode.NoWrap)
        self.setAccessibleName(_("Python program"))
        self.document().setDocumentMargin(16)
        self._highlighter = _Highlighter(self.document(), theme)
        FieldContextMenu(theme, self)
        theme.changed.connect(self._restyle)
        self._restyle()

    def _restyle(self) -> None:
        font = self._theme.font("code")
        font.setPixelSize(round(self._theme.scaled(13)))
        self.setFont(font)
        self._highlighter.rehighlight()

    def show_program(self, source: str) -> None:
        """Show the program and keep the scroll position."""
        if source != self.toPlainText():
            bar = self.verticalScrollBar()
            scroll_position = bar.value()
            self.setPlainText(source)
            bar.setValue(scroll_position)

    def line_containing(self, text: str) -> int:
        """Return the number (from 1) of the first line that contains `text`, or 0 if there is none."""
        cursor = self.document().find(QRegularExpression(QRegularExpression.escape(text)))
        return cursor.blockNumber() + 1 if not cursor.isNull() else 0
