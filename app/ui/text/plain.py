"""Names from the network are words, never markup: in tooltips, where Qt guesses, and in menus.

Qt takes a tooltip that looks like HTML for HTML. A node could then be called ``<img src="//server/share">``,
and pointing at its name would show a file of this computer, or tell a server who is here.
"""

from __future__ import annotations

import html
import unicodedata

from PySide6.QtGui import Qt

LONG_WORD, PIECE = 20, 4
MAY_BREAK = "\u200b"  # shows nothing; a line may end there


def breakable(words: str) -> str:
    """The same, with places in very long words where a line may end: a label cuts off what it can't break."""
    return " ".join(_pieces(word) if len(word) > LONG_WORD else word for word in words.split(" "))


def _pieces(word: str) -> str:
    """A letter and what belongs to it (accents, joined signs) stay together."""
    made, since = "", 0
    for letter in word:
        if since >= PIECE and not unicodedata.combining(letter) and unicodedata.category(letter)[0] in "LN":
            made, since = made + MAY_BREAK, 0
        made, since = made + letter, since + 1
    return made


def tip(words: str) -> str:
    """What `setToolTip` shows as exactly these words."""
    if not Qt.mightBeRichText(words):
        return words
    return f'<span style="white-space: pre-wrap">{html.escape(words)}</span>'


def entry(name: str) -> str:
    """What a menu shows as exactly this name: an ampersand is no key, a tab begins no shortcut."""
    return name.replace("&", "&&").replace("\t", " ")
