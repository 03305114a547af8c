"""URL scheme ``app://blocks/…``, which serves the block editor's page from the resources and nothing else.

`register_scheme` must be called before the first view or profile is created. Qt recommends calling it before
the QApplication is created; Studio calls it later, because importing Qt WebEngine takes long.
"""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import QBuffer, QByteArray, QFile, QIODevice, QObject
from PySide6.QtWebChannel import QWebChannel  # noqa: F401 (brings :/qtwebchannel/qwebchannel.js)
from PySide6.QtWebEngineCore import (
    QWebEngineUrlRequestInfo,
    QWebEngineUrlRequestInterceptor,
    QWebEngineUrlRequestJob,
    QWebEngineUrlScheme,
    QWebEngineUrlSchemeHandler,
)

from app import resources

SCHEME = b"app"
HOST = "blocks"
PAGE_URL = f"{SCHEME.decode()}://{HOST}/index.html"
ALLOWED_SCHEMES = frozenset({"app", "data", "blob"})

_MEDIA_TYPES = {
    ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json",
    ".svg": "image/svg+xml", ".png": "image/png", ".gif": "image/gif", ".cur": "image/x-icon",
    ".otf": "font/otf", ".ttf": "font/ttf", ".txt": "text/plain",
}  # fmt: skip
_FONT_WEIGHTS = {"Regular": 400, "Medium": 500, "SemiBold": 600, "Bold": 700}


def register_scheme() -> None:
    """Register ``app:`` as a secure scheme. Call this before the first view is created. Idempotent."""
    if QWebEngineUrlScheme.schemeByName(QByteArray(SCHEME)).name() == SCHEME:
        return
    scheme = QWebEngineUrlScheme(QByteArray(SCHEME))
    scheme.setSyntax(QWebEngineUrlScheme.Syntax.Host)
    scheme.setFlags(
        QWebEngineUrlScheme.Flag.SecureScheme
        | QWebEngineUrlScheme.Flag.CorsEnabled
        | QWebEngineUrlScheme.Flag.FetchApiAllowed
    )
    QWebEngineUrlScheme.registerScheme(scheme)


def read_content(path: str, folder: Path | None = None) -> tuple[str, bytes] | None:
    """Return the media type and the content of a file of the page, or None if no such file is served.

    Only files with a known suffix are served. Paths can't leave the editor's folder, except to the bundled
    fonts under ``/fonts/``. ``/fonts.css`` and ``/qwebchannel.js`` are generated.

    Args:
        path: Path in the URL, such as ``/editor.js``.
        folder: Folder with the resources (default: `app.resources.folder()`).
    """
    root = resources.folder() if folder is None else folder
    if path == "/fonts.css":
        return "text/css", _font_faces(root / "fonts").encode()
    if path == "/qwebchannel.js":
        return "text/javascript", _qwebchannel()
    base, name = (root / "fonts", path[7:]) if path.startswith("/fonts/") else (root / "blockly", path[1:])
    file = (base / name).resolve()
    kind = _MEDIA_TYPES.get(file.suffix)
    if kind is None or not file.is_relative_to(base.resolve()) or not file.is_file():
        return None
    return kind, file.read_bytes()


def _font_faces(folder: Path) -> str:
    # One `@font-face` for each bundled weight of Inter and M PLUS 1p; empty without fonts.
    return "\n".join(
        f'@font-face{{font-family:"{family}";font-weight:{_FONT_WEIGHTS[file.stem.partition("-")[2]]};'
        f'src:url("fonts/{file.name}");font-display:block}}'
        for family, prefix in (("Inter", "Inter"), ("M PLUS 1p", "MPLUS1p"))
        for file in sorted(folder.glob(f"{prefix}-*.[ot]tf"))
    )


def _qwebchannel() -> bytes:
    file = QFile(":/qtwebchannel/qwebchannel.js")
    file.open(QIODevice.OpenModeFlag.ReadOnly)
    try:
        return bytes(file.readAll().data())
    finally:
        file.close()


class SchemeHandler(QWebEngineUrlSchemeHandler):
    """Handler that serves ``app://blocks/…`` and rejects any other host, method or path."""

    def requestStarted(self, job: QWebEngineUrlRequestJob) -> None:
        url = job.requestUrl()
        if url.host() != HOST or job.requestMethod() != b"GET":
            job.fail(QWebEngineUrlRequestJob.Error.RequestDenied)
            return
        content = read_content(url.path())
        if content is None:
            job.fail(QWebEngineUrlRequestJob.Error.UrlNotFound)
            return
        kind, data = content
        buffer = QBuffer(job)
        buffer.setData(QByteArray(data))
        buffer.open(QIODevice.OpenModeFlag.ReadOnly)
        job.reply(QByteArray(kind.encode()), buffer)


class RequestBlocker(QWebEngineUrlRequestInterceptor):
    """Request interceptor that blocks everything except local content.

    Attributes:
        blocked_urls: URLs of the first 100 blocked requests, for tests.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.blocked_urls: list[str] = []

    def interceptRequest(self, info: QWebEngineUrlRequestInfo) -> None:
        info.block(True)  # blocked first, so that an exception below can't let the request through
        if info.requestUrl().scheme() in ALLOWED_SCHEMES:
            info.block(False)
            return
        if len(self.blocked_urls) < 100:
            self.blocked_urls.append(info.requestUrl().toString())
