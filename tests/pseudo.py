"""Pseudo-language generated from the current sources: text that is not translatable stays plain English.

    def test_every_word_is_translated(pseudo) -> None:
        shown = visible_text()                       # "[Ƥéƥƥéř đíđ ñóť áñšŵéř ~~~~]"
        assert untranslated(shown, "Pepper") == []   # data, which is never translated

The fixture ``pseudo`` is in tests/conftest.py. A text that is not marked (by `_`, `lazy`, `plazy`,
`ngettext`, `pgettext`, as text of a block or of an example) stays English, even if it is passed to `_`.
Use `untranslated_in` for a widget and its children. Neither Babel nor compiled catalogues are needed.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from gettext import NullTranslations
from pathlib import Path
from typing import TYPE_CHECKING

from nep import i18n
from tools.pseudo import MARKUP, pseudo, sentences_of_blocks, sentences_of_examples

if TYPE_CHECKING:
    from PySide6.QtGui import QAction
    from PySide6.QtWidgets import QWidget

ROOT = Path(__file__).resolve().parents[1]
MARKS = {"_": 1, "gettext": 1, "lazy": 1, "ngettext": 2, "pgettext": 2, "plazy": 2}
"""Functions that mark translatable texts, with their number of string arguments."""
UNITS = frozenset({
    "GB", "Hz", "KB", "MB", "TB", "cm", "deg", "fps", "kB", "kHz", "km", "mW", "min", "mm", "ms", "ns", "px",
    "rad",
})  # fmt: skip
NAMES = frozenset({
    "Alt", "Blockly", "Ctrl", "DNS", "Del", "Enter", "Esc", "F1", "HTTP", "ID", "IP", "JSON", "Linux", "NEP",
    "OpenCV", "PNG", "Pepper", "PySide6", "Python", "Qt", "RIZE", "ROS", "Return", "Shift", "Space", "Studio",
    "TCP", "Tab", "UDP", "Windows", "ZeroMQ", "macOS", "nep",
})  # fmt: skip
"""Proper names and names of keys, which are the same in every language."""

_GAP = r"(?:\s|#.*\n)*"
_STRING = r'''[rRuU]?(?:"""(?:\\[\s\S]|[^\\])*?"""|"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')'''
_TEXT = rf"{_STRING}(?:{_GAP}{_STRING})*"
_CALL = re.compile(  # parsing all sources with ast takes nine times as long
    rf"(?<![\w.])({'|'.join(MARKS)})\({_GAP}({_TEXT}){_GAP}(?:,{_GAP}({_TEXT}){_GAP})?(?=[,)])"
)
_MODULE_DOCSTRING = re.compile(r'\A"""[\s\S]*?"""')
_WORD = re.compile(r"[A-Za-z][A-Za-z']+")
_TAG = re.compile(r"<[^<>]*>|&[a-z]+;")
_PATTERN = {"2": "[{0} àñđ {1}]", "start": "{0}, {1}", "middle": "{0}, {1}", "end": "[{0} àñđ {1}]"}
_FACTS: Mapping[str, object] = {
    "and": _PATTERN,
    "or": {name: pattern.replace("àñđ", "óř") for name, pattern in _PATTERN.items()},
    "months": [f"[ḿóñťĥ {number}]" for number in range(1, 13)],
    "decimal": ",",
}


class _Pseudo(NullTranslations):
    """Translations of the marked texts into the pseudo-language."""

    def gettext(self, message: str) -> str:
        return pseudo(message) if (None, message) in marked() else message

    def pgettext(self, context: str, message: str) -> str:
        return pseudo(message) if (context, message) in marked() else message

    def ngettext(self, msgid1: str, msgid2: str, n: int) -> str:
        told = msgid1 if n == 1 else msgid2
        return pseudo(told) if (msgid1, msgid2) in marked() else told


def words() -> object:
    """Return the catalogue that `nep.i18n` holds while the pseudo-language is active."""
    return i18n._Catalogue(i18n.PSEUDO_LANGUAGE, _Pseudo(), _FACTS)


@lru_cache(maxsize=1)
def marked() -> frozenset[tuple[str | None, str]]:
    """Return (context, text) of every marked text; for `ngettext`, (singular, plural)."""
    told = (*sentences_of_blocks(), *sentences_of_examples())
    found: set[tuple[str | None, str]] = {(context, english) for context, english, _place in told}
    for folder in ("nep", "app"):
        for path in (ROOT / folder).rglob("*.py"):
            found.update(_marked_in(path.read_text(encoding="utf-8")))
    return frozenset(found)


def _marked_in(source: str) -> Iterator[tuple[str | None, str]]:
    for mark, *literals in _CALL.findall(_MODULE_DOCSTRING.sub("", source)):
        given = [ast.literal_eval(f"({each})") for each in literals if each][: MARKS[mark]]
        if len(given) == MARKS[mark]:
            yield (None, given[0]) if len(given) == 1 else (given[0], given[1])


def untranslated(text: str, *data: str) -> list[str]:
    """Return the English words of a text, without `data`, markup, units and names."""
    plain = MARKUP.sub(" ", _TAG.sub(" ", text))
    for each in sorted((each for each in data if each and each in plain), key=len, reverse=True):
        plain = re.sub(rf"(?<![A-Za-z]){re.escape(each)}(?![A-Za-z])", " ", plain)
    return [word for word in _WORD.findall(plain) if word not in UNITS and word not in NAMES]


def untranslated_in(widget: QWidget, *data: str, hidden: bool = True) -> list[str]:
    """Return the untranslated texts of a widget and its children, such as "QLabel#name.text: Stop now".

    With ``hidden=False`` only visible widgets count.
    """
    return [
        f"{place}: {text}" for place, text in texts_of(widget, hidden=hidden) if untranslated(text, *data)
    ]


def texts_of(widget: QWidget, *, hidden: bool = True) -> Iterator[tuple[str, str]]:
    """Yield the place and text of every text of a widget and its children, including tool tips."""
    from PySide6.QtWidgets import QWidget

    for each in (widget, *widget.findChildren(QWidget)):
        if not hidden and not each.isVisible():
            continue
        place = f"{type(each).__name__}#{each.objectName()}"
        for name, text in (*_own_texts(each), *_texts_of_items(each)):
            if text:
                yield f"{place}.{name}", text
        for action in each.actions():
            for name, text in _texts_of_action(action):
                yield f"{place}.{name}", text


def _own_texts(widget: QWidget) -> Iterable[tuple[str, str]]:
    from PySide6.QtWidgets import QAbstractButton, QDockWidget, QGroupBox, QLabel, QLineEdit, QMenu

    yield "accessibleName", widget.accessibleName()
    yield "accessibleDescription", widget.accessibleDescription()
    yield "toolTip", widget.toolTip()
    yield "statusTip", widget.statusTip()
    yield "whatsThis", widget.whatsThis()
    if widget.isWindow() or isinstance(widget, QDockWidget):
        yield "windowTitle", widget.windowTitle()
    if isinstance(widget, (QLabel, QAbstractButton)):
        yield "text", widget.text()
    if isinstance(widget, (QGroupBox, QMenu)):
        yield "title", widget.title()
    if isinstance(widget, QLineEdit) or hasattr(widget, "placeholderText"):
        yield "placeholderText", widget.placeholderText()


def _texts_of_items(widget: QWidget) -> Iterable[tuple[str, str]]:
    from PySide6.QtCore import QAbstractListModel, Qt
    from PySide6.QtWidgets import QAbstractItemView, QComboBox, QTabBar

    if isinstance(widget, QTabBar):
        for index in range(widget.count()):
            yield "tabText", widget.tabText(index)
            yield "tabToolTip", widget.tabToolTip(index)
    if isinstance(widget, QComboBox):
        for index in range(widget.count()):
            yield "itemText", widget.itemText(index)
    if isinstance(widget, QAbstractItemView) and (model := widget.model()) is not None:
        columns = 0 if isinstance(model, QAbstractListModel) else model.columnCount()  # no headers in lists
        for column in range(columns):
            for role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.ToolTipRole):
                head = model.headerData(column, Qt.Orientation.Horizontal, role)
                if isinstance(head, str):
                    yield "head", head


def _texts_of_action(action: QAction) -> Iterable[tuple[str, str]]:
    for name, text in (("action", action.text()), ("actionTip", action.toolTip())):
        if text:
            yield name, text
