"""Names from the network are words, never markup: in tooltips, where Qt guesses, and in menus.

Qt takes a tooltip that looks like HTML for HTML. A node could then be called ``<img src="//server/share">``,
and pointing at its name would show a file of this computer, or tell a server who is here.
"""

from __future__ import annotations

import html

from PySide6.QtGui import Qt


def tip(words: str) -> str:
    """What `setToolTip` shows as exactly these words."""
    if not Qt.mightBeRichText(words):
        return words
    return f'<span style="white-space: pre-wrap">{html.escape(words)}</span>'


def entry(name: str) -> str:
    """What a menu shows as exactly this name: an ampersand is no key, a tab begins no shortcut."""
    return name.replace("&", "&&").replace("\t", " ")
