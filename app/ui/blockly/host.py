"""Host of the block editor's web page, with an off-the-record profile and without access to the network.

The host creates and styles the page, restarts it when its process dies, and receives its function keys.
"""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Mapping
from typing import Literal, cast

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, QTimer, QUrl, Signal
from PySide6.QtGui import QColor, QGuiApplication, QKeyEvent, QKeySequence, QShowEvent
from PySide6.QtWebChannel import QWebChannel
from PySide6.QtWebEngineCore import QWebEnginePage, QWebEngineProfile, QWebEngineSettings
from PySide6.QtWebEngineWidgets import QWebEngineView
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app import resources
from app.core.reports.crash import crash_extra
from app.ui.blockly import messages
from app.ui.blockly.bridge import BlocklyBridge
from app.ui.blockly.key_buffer import KeyBuffer
from app.ui.blockly.scheme import PAGE_URL, SCHEME, RequestBlocker, SchemeHandler, register_scheme
from app.ui.widgets.keyboard import focus_proxy, is_keyboard_navigation
from nep import i18n

_log = logging.getLogger(__name__)
_RESTART_DELAYS_MS = (0, 500, 2000, 5000)
_STABLE_AFTER_S = 60.0
CLIPBOARD_PREFIX = '{"nepStudio":'
"""Prefix of the clipboard's text if it contains copied blocks; the same as in `clipboard.ts`."""
MAX_CLIPBOARD_CHARS = 5_000_000
_FUNCTION_KEYS = range(Qt.Key.Key_F1, Qt.Key.Key_F12 + 1)
_Attribute = QWebEngineSettings.WebAttribute
_DISABLED_ATTRIBUTES = (
    _Attribute.JavascriptCanOpenWindows, _Attribute.LocalContentCanAccessRemoteUrls,
    _Attribute.LocalContentCanAccessFileUrls, _Attribute.PluginsEnabled, _Attribute.PdfViewerEnabled,
    _Attribute.HyperlinkAuditingEnabled, _Attribute.FullScreenSupportEnabled, _Attribute.ErrorPageEnabled,
    _Attribute.NavigateOnDropEnabled, _Attribute.AutoLoadIconsForPage, _Attribute.WebGLEnabled,
    _Attribute.ShowScrollBars, _Attribute.FocusOnNavigationEnabled,
)  # fmt: skip


class BlocklyPage(QWebEnginePage):
    """Page that can only navigate within the editor; errors of its scripts are logged."""

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
        is_error = level == QWebEnginePage.JavaScriptConsoleMessageLevel.ErrorMessageLevel
        _log.log(logging.ERROR if is_error else logging.DEBUG, "%s (%s:%d)", message, source, line)


class BlocklyWeb:
    """Web view of the editor with its page, profile, channel and request filter.

    Args:
        bridge: Object that the page can access.
        background: Background colour before the first paint.
        owner: Widget that owns the view and the profile.
    """

    def __init__(self, bridge: BlocklyBridge, background: QColor, owner: QWidget) -> None:
        register_scheme()
        self.view = QWebEngineView(owner)
        self.view.setContextMenuPolicy(Qt.ContextMenuPolicy.NoContextMenu)
        profile = QWebEngineProfile(None)
        self._profile = profile
        self.request_blocker = RequestBlocker(profile)
        self._handler = SchemeHandler(profile)
        profile.setUrlRequestInterceptor(self.request_blocker)
        profile.installUrlSchemeHandler(SCHEME, self._handler)
        self.page = BlocklyPage(profile, self.view)
        self.page.setBackgroundColor(background)
        for attribute in _DISABLED_ATTRIBUTES:
            self.page.settings().setAttribute(attribute, False)
        channel = QWebChannel(self.page)
        channel.registerObject("bridge", bridge)
        self.page.setWebChannel(channel)
        self.view.setPage(self.page)
        # Qt deletes children in the order of their adoption; a profile must outlive its pages.
        profile.setParent(owner)

    def start(self) -> None:
        """Load the editor's page, for the first time or after the page's process was terminated."""
        self.page.load(QUrl(PAGE_URL))

    def close(self) -> None:
        """Delete the view with its page, and then the profile, when control returns to the event loop."""
        self.view.deleteLater()
        self._profile.deleteLater()

    def keyboard_target(self) -> QObject | None:
        """Return the widget that receives key presses while the page has the focus; None before it exists."""
        return focus_proxy(self.view)


class BlocklyHost(QWidget):
    """Widget that contains the page, creates it on the first show, and reloads it when its process dies."""

    ready = Signal()  # the page is loaded (again, after its process died)
    recovered = Signal()  # the page's process died and every behaviour was restored, without its undo stack
    key_pressed = Signal(str)  # function key pressed in the page that isn't a shortcut of the window

    def __init__(self, parent: QWidget | None, language: str) -> None:
        super().__init__(parent)
        self._language = language
        self._web: BlocklyWeb | None = None
        self._is_page_ready = False
        self._theme: messages.EditorTheme | None = None
        self._is_motion_reduced = False
        self._is_pinned: bool | None = None
        self._termination_count = 0
        self._has_terminated = False
        self._ready_since_s = 0.0
        self._bridge = BlocklyBridge(self._receive, self)
        self._keys = KeyBuffer(lambda: self._web.keyboard_target() if self._web is not None else None)
        self._requested_field: messages.RunCommand | None = None  # None when the field has the focus
        self._is_block_focused = False
        self._layout = QVBoxLayout(self)
        self._layout.setContentsMargins(0, 0, 0, 0)

    @property
    def is_ready(self) -> bool:
        """True if the page is loaded."""
        return self._is_page_ready

    @property
    def web(self) -> BlocklyWeb | None:
        """Web view, or None before the first show. Used by tools and tests."""
        return self._web

    def set_theme(self, tokens: Mapping[str, object], is_dark: bool) -> None:
        """Set the colours and sizes of the page; blocks and undo stack are preserved.

        Args:
            tokens: Design tokens: the parsed token file, or `Theme.blockly_tokens()`.
            is_dark: True for the dark theme.
        """
        self._theme = messages.EditorTheme(dict(tokens), is_dark)
        if isinstance(tokens.get("reducedMotion"), bool):
            self.set_reduced_motion(bool(tokens["reducedMotion"]))
        if self._web is not None:
            self._apply_theme(self._web)
        self._send(messages.SetTheme(self._theme))

    def set_reduced_motion(self, is_reduced: bool) -> None:
        """Select a steady glow for running blocks if ``is_reduced`` is True, else an animated one."""
        if is_reduced != self._is_motion_reduced:
            self._is_motion_reduced = is_reduced
            self._send(messages.SetReducedMotion(is_reduced))

    # -- for the view -----------------------------------------------------------------------------

    def _on_page_loaded(self) -> None:
        # Overridden by subclasses: the page is loaded and has no state yet.
        ...

    def _on_page_lost(self) -> None:
        # Overridden by subclasses: the page and its state are lost.
        ...

    def _receive(self, message: messages.PageMessage) -> None:
        # Overridden by subclasses: the page sent a message.
        ...

    def _send(self, message: messages.WindowMessage) -> None:
        # Messages without a page are dropped; `_on_page_loaded` sends the complete state to a later page.
        if self._is_page_ready:
            self._bridge.send(message)

    def _request_field(self, field: Literal["find", "search"]) -> None:
        # Holds keys that are pressed before the field has the focus.
        if self._web is None:
            return
        self._requested_field = messages.RunCommand(field)
        self._install_key_filter()
        self._keys.start()
        self._send(self._requested_field)

    # -- page -------------------------------------------------------------------------------------

    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        if self._web is None:
            QTimer.singleShot(0, self, self._create_page)  # let the window respond to the user first

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        if event.type() == QEvent.Type.ChildAdded:
            self._install_key_filter()
        if self._keys.buffer_event(event):
            return True
        if event.type() == QEvent.Type.FocusIn and is_keyboard_navigation():
            self._send(messages.RunCommand("showFocus"))
        is_override = event.type() == QEvent.Type.ShortcutOverride and self._is_block_focused
        if is_override and _is_help_key(cast("QKeyEvent", event)):
            event.accept()  # on a block, F1 shows the block's help instead of the window's
            return True
        if event.type() == QEvent.Type.KeyPress:
            key = cast("QKeyEvent", event)
            # A shortcut of the window is handled before the key press arrives here.
            if key.key() in _FUNCTION_KEYS and key.modifiers() == Qt.KeyboardModifier.NoModifier:
                if self._is_block_focused and _is_help_key(key):
                    self._send(messages.RunCommand("help"))
                else:
                    self.key_pressed.emit(QKeySequence(key.key()).toString())
                return True
        return super().eventFilter(watched, event)

    def _create_page(self) -> None:
        if self._web is not None or not self.isVisible():
            return
        self._web = BlocklyWeb(self._bridge, self._background_colour(), self)
        self._layout.addWidget(self._web.view)
        self.setFocusProxy(self._web.view)
        self._web.view.installEventFilter(self)
        self._web.page.renderProcessTerminated.connect(self._on_process_terminated)
        self._apply_theme(self._web)
        application = QCoreApplication.instance()
        if application is not None:
            application.aboutToQuit.connect(self._close_page)
        self._web.start()

    def _close_page(self) -> None:
        # Deletes the page before its profile, whatever order the interpreter uses at exit.
        web, self._web, self._is_page_ready = self._web, None, False
        if web is not None:
            web.close()

    def _apply_theme(self, web: BlocklyWeb) -> None:
        # Styles outside the page's control: background before the first paint, text size.
        web.page.setBackgroundColor(self._background_colour())
        percent = self._loaded_theme().tokens.get("textPercent")
        web.view.setZoomFactor(percent / 100 if isinstance(percent, int | float) else 1.0)

    def _install_key_filter(self) -> None:
        # The web engine creates the widget that receives keys, and a new one for each process.
        key_target = self._web.keyboard_target() if self._web is not None else None
        if self._web is not None:
            self._web.view.setAcceptDrops(False)
        if key_target is not None:
            if isinstance(key_target, QWidget):
                key_target.setAcceptDrops(False)  # the window handles dropped files
            key_target.removeEventFilter(self)
            key_target.installEventFilter(self)
            if isinstance(key_target, QWidget):
                key_target.setAcceptDrops(False)  # the window handles dropped files

    def _loaded_theme(self) -> messages.EditorTheme:
        if self._theme is None:
            tokens = json.loads(resources.path("theme", "tokens.json").read_text("utf-8"))
            self._theme = messages.EditorTheme(tokens, is_dark=False)
        return self._theme

    def _background_colour(self) -> QColor:
        theme = self._loaded_theme()
        colours = cast("Mapping[str, object]", theme.tokens["colour"])
        mode = colours.get("dark" if theme.is_dark else "light", colours)
        return QColor(str(cast("Mapping[str, object]", mode)["workspace"]))

    def _on_host_message(self, message: messages.HostMessage) -> None:
        match message:
            case messages.PageOpened():
                self._start_page()
            case messages.PageReady():
                self._on_page_ready()
            case messages.PageFailed():
                _log.error("block editor: %s", message.text)
            case messages.FieldOpened():
                self._requested_field = None
                self._keys.release()
            case messages.BlockFocusChanged():
                self._is_block_focused = message.is_focused
            case messages.BlocksCopied():
                QGuiApplication.clipboard().setText(message.text)
            case messages.ClipboardRequested():
                self._bridge.send(messages.ClipboardText(copied_blocks()))
            case _:
                messages.reject_unhandled(message)

    def _start_page(self) -> None:
        self._bridge.send(
            messages.StartEditor(
                self._language,
                dict(i18n.editor_translations()),
                self._is_motion_reduced,
                self._is_pinned,
                self._loaded_theme(),
            )
        )

    def _on_page_ready(self) -> None:
        self._is_page_ready = True
        self._ready_since_s = time.monotonic()
        self._install_key_filter()
        self._on_page_loaded()
        if self._requested_field is not None:
            self._send(self._requested_field)
        self.ready.emit()
        if self._has_terminated:
            self._has_terminated = False
            self.recovered.emit()

    def _on_process_terminated(
        self, status: QWebEnginePage.RenderProcessTerminationStatus, code: int
    ) -> None:
        is_crash = status != QWebEnginePage.RenderProcessTerminationStatus.NormalTerminationStatus
        description = f"the web process of the block editor ended (code {code}, {status.name})"
        _log.warning(
            "the web process of the block editor ended (code %d); restarting it",
            code,
            extra=crash_extra("editor", description) if is_crash else None,
        )
        self._is_page_ready = self._is_block_focused = False
        self._has_terminated = True
        self._requested_field = None
        self._keys.discard_all()
        self._on_page_lost()
        if time.monotonic() - self._ready_since_s > _STABLE_AFTER_S:
            self._termination_count = 0
        delay_ms = _RESTART_DELAYS_MS[min(self._termination_count, len(_RESTART_DELAYS_MS) - 1)]
        self._termination_count += 1
        if self._web is not None:
            QTimer.singleShot(delay_ms, self._web.page, self._web.start)


def copied_blocks() -> str:
    """Return the serialized blocks on the system clipboard; "" if it contains anything else.

    The page must not read other contents of the clipboard.
    """
    text = QGuiApplication.clipboard().text()
    return text if text.startswith(CLIPBOARD_PREFIX) and len(text) <= MAX_CLIPBOARD_CHARS else ""


def _is_help_key(key: QKeyEvent) -> bool:
    return key.key() == Qt.Key.Key_F1 and key.modifiers() == Qt.KeyboardModifier.NoModifier
