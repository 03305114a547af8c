"""Web page that the editors of several tests use one after the other.

A new page starts a process, which compiles the editor's scripts again: this took half of the time of a test.
"""

from __future__ import annotations

import shiboken6
from PySide6.QtCore import QEventLoop, QTimer, QUrl
from PySide6.QtGui import QColor
from PySide6.QtWebChannel import QWebChannel
from PySide6.QtWidgets import QWidget

from app.ui.blockly.bridge import BlocklyBridge
from app.ui.blockly.host import BlocklyWeb
from app.ui.blockly.scheme import HOST, SCHEME

_BLANK_URL = f"{SCHEME.decode()}://{HOST}/media/1x1.gif"  # a page without scripts in the same process
_BLANK_TIMEOUT_MS = 10_000


class ReusableWeb(BlocklyWeb):
    """Web view of the editor that a later editor can use, if its process has not died.

    Args:
        bridge: Object that the page can access.
        background: Background colour before the first paint.
        owner: Widget that contains the view.
    """

    def __init__(self, bridge: BlocklyBridge, background: QColor, owner: QWidget) -> None:
        super().__init__(bridge, background, owner)
        self.owner = owner
        self._has_terminated = False
        self._profile.setParent(None)  # it must outlive the page, which may lose its owner
        self.page.renderProcessTerminated.connect(self._on_terminated)

    def attach(self, bridge: BlocklyBridge, background: QColor, owner: QWidget) -> None:
        """Give the page to another editor, which loads it again. The arguments are those of the class."""
        self.owner = owner
        self.view.setParent(owner)
        self.view.show()
        self.page.setBackgroundColor(background)
        channel = QWebChannel(self.page)
        channel.registerObject("bridge", bridge)
        self.page.setWebChannel(channel)

    def detach(self) -> bool:
        """Take the page from its editor and unload it. Return False if the page can't be used again."""
        if not shiboken6.isValid(self.view) or not shiboken6.isValid(self.owner):
            return False
        channel = self.page.webChannel()
        self.page.setWebChannel(None)
        channel.deleteLater()
        self.page.renderProcessTerminated.disconnect()
        self.page.renderProcessTerminated.connect(self._on_terminated)
        self.view.removeEventFilter(self.owner)
        self.view.hide()
        self.view.setParent(None)
        self.request_blocker.blocked_urls.clear()
        return not self._has_terminated and self._unload()

    def close(self) -> None:
        if shiboken6.isValid(self.view):
            self.view.deleteLater()
        self._profile.deleteLater()

    def _unload(self) -> bool:
        # Waits until the scripts of the old page have ended: their messages must not reach the next editor.
        loop = QEventLoop()
        QTimer.singleShot(_BLANK_TIMEOUT_MS, loop, loop.quit)
        self.page.loadFinished.connect(loop.quit)
        self.page.load(QUrl(_BLANK_URL))
        loop.exec()
        self.page.loadFinished.disconnect(loop.quit)
        return self.page.url() == QUrl(_BLANK_URL) and not self._has_terminated

    def _on_terminated(self) -> None:
        self._has_terminated = True


class PagePool:
    """Lends one page to the editors of consecutive tests; further editors of a test get their own page."""

    def __init__(self) -> None:
        self._free: ReusableWeb | None = None
        self._lent: list[ReusableWeb] = []

    def lend(self, bridge: BlocklyBridge, background: QColor, owner: QWidget) -> BlocklyWeb:
        """Return the free page or a new one. The arguments are those of `BlocklyWeb`."""
        web, self._free = self._free, None
        if web is None:
            web = ReusableWeb(bridge, background, owner)
        else:
            web.attach(bridge, background, owner)
        self._lent.append(web)
        return web

    def take_back(self) -> None:
        """Take the pages back from the editors of a test and keep one that can be used again."""
        lent, self._lent = self._lent, []
        for web in lent:
            if web.detach() and self._free is None:
                self._free = web
            else:
                web.close()

    def close(self) -> None:
        """Close the free page."""
        self.take_back()
        web, self._free = self._free, None
        if web is not None:
            web.close()
