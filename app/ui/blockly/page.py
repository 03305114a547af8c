"""The web page that shows the block editor: off the record, fenced in, nothing remote."""

from __future__ import annotations

import logging

from PySide6.QtCore import QObject, Qt, QUrl
from PySide6.QtGui import QColor
from PySide6.QtWebChannel import QWebChannel
from PySide6.QtWebEngineCore import QWebEnginePage, QWebEngineProfile, QWebEngineSettings
from PySide6.QtWebEngineWidgets import QWebEngineView
from PySide6.QtWidgets import QWidget

from app.ui.blockly.bridge import BlocklyBridge
from app.ui.blockly.scheme import PAGE, SCHEME, Fence, SchemeHandler, register_scheme
from app.ui.widgets.keyboard import proxy_of

_log = logging.getLogger(__name__)
_Attribute = QWebEngineSettings.WebAttribute
_OFF = (
    _Attribute.JavascriptCanOpenWindows, _Attribute.LocalContentCanAccessRemoteUrls,
    _Attribute.LocalContentCanAccessFileUrls, _Attribute.PluginsEnabled, _Attribute.PdfViewerEnabled,
    _Attribute.HyperlinkAuditingEnabled, _Attribute.FullScreenSupportEnabled, _Attribute.ErrorPageEnabled,
    _Attribute.NavigateOnDropEnabled, _Attribute.AutoLoadIconsForPage, _Attribute.WebGLEnabled,
    _Attribute.ShowScrollBars, _Attribute.FocusOnNavigationEnabled,
)  # fmt: skip


class BlocklyPage(QWebEnginePage):
    """Shows nothing but the editor; what its scripts complain about goes to the log."""

    def acceptNavigationRequest(
        self, url: QUrl | str, _kind: QWebEnginePage.NavigationType, _is_main: bool
    ) -> bool:
        return QUrl(url).scheme() == SCHEME.decode()

    def javaScriptConsoleMessage(
        self,
        level: QWebEnginePage.JavaScriptConsoleMessageLevel,
        message: str,
        line: int,
        source: str,
    ) -> None:
        serious = level == QWebEnginePage.JavaScriptConsoleMessageLevel.ErrorMessageLevel
        _log.log(logging.ERROR if serious else logging.DEBUG, "%s (%s:%d)", message, source, line)


class BlocklyWeb:
    """A web view with its page, profile, channel and fence, all owned by one widget."""

    def __init__(self, bridge: BlocklyBridge, background: QColor, owner: QWidget) -> None:
        register_scheme()
        self.view = QWebEngineView(owner)
        self.view.setContextMenuPolicy(Qt.ContextMenuPolicy.NoContextMenu)
        profile = QWebEngineProfile(None)
        self._profile = profile
        self.fence = Fence(profile)
        self._handler = SchemeHandler(profile)
        profile.setUrlRequestInterceptor(self.fence)
        profile.installUrlSchemeHandler(SCHEME, self._handler)
        self.page = BlocklyPage(profile, self.view)
        self.page.setBackgroundColor(background)
        for attribute in _OFF:
            self.page.settings().setAttribute(attribute, False)
        channel = QWebChannel(self.page)
        channel.registerObject("bridge", bridge)
        self.page.setWebChannel(channel)
        self.view.setPage(self.page)
        # Children are deleted in the order of their adoption; a profile must outlive its pages.
        profile.setParent(owner)

    def start(self) -> None:
        """Load the editor, also again after the web process was killed."""
        self.page.load(QUrl(PAGE))

    def close(self) -> None:
        """Delete the view and its page, then the profile, when control returns to the event loop."""
        self.view.deleteLater()
        self._profile.deleteLater()

    def keyboard(self) -> QObject | None:
        """The widget that receives the keys while the page has the focus."""
        return proxy_of(self.view)
