"""Selection of the library files that go into a package.

Qt is the largest part of a package. `is_wanted` checks each file that PyInstaller collects by its path
below the frozen program's folder. A file is omitted if no code of Studio uses it and no library in the
package is linked with it; the packages' self-test would fail otherwise.
"""

from __future__ import annotations

import re
from pathlib import PurePosixPath

__all__ = ["EXCLUDED_MODULES", "UNUSED_OF_PYQTGRAPH", "is_wanted"]

UNUSED_OF_PYQTGRAPH = ("console", "dockarea", "examples", "exporters", "flowchart", "jupyter", "opengl")
"""Parts of pyqtgraph that only its menus use, which Studio doesn't show."""

EXCLUDED_MODULES = (
    *(f"pyqtgraph.{name}" for name in UNUSED_OF_PYQTGRAPH),
    "PySide6.QtTest", "OpenGL", "numba", "cupy", "scipy",  # optional imports of pyqtgraph
    "PySide6.QtQml", "PySide6.QtQuick",  # QtWebEngine needs only their libraries; their hooks add all of QML
    "tkinter", "_tkinter", "turtle", "idlelib", "lib2to3", "pydoc_data", "ensurepip", "pip", "setuptools",
    "wheel", "pkg_resources", "IPython", "matplotlib", "PIL", "pytest", "_pytest", "hypothesis", "mypy",
    "babel", "numpy.f2py", "numpy.distutils",
    "readline",  # under the GNU General Public License; not used by Studio
)  # fmt: skip

_LANGUAGES = ("en", "es", "fr", "ja")
_CHROMIUM_LANGUAGES = ("en-US", "en-GB", "es", "es-419", "fr", "ja")
_PLUGINS = frozenset({
    "iconengines", "imageformats", "networkinformation", "platforminputcontexts", "platforms",
    "platformthemes", "printsupport", "styles", "texttospeech", "tls", "wayland-decoration-client",
    "wayland-graphics-integration-client", "wayland-shell-integration", "xcbglintegrations",
})  # fmt: skip
_QT_FFMPEG = re.compile(r"(?:lib)?(?:av(?:codec|format|util)|sw(?:scale|resample))(?:-\d+\.dll|\.)")
"""FFmpeg libraries for video; Studio plays only tones, which don't need them."""
_NOT_PLUGINS = re.compile(r"(?:lib)?(?:qgtk3|qtvirtualkeyboardplugin|qtexttospeech_mock|ffmpegmediaplugin)\b")
"""Excluded plug-ins in included folders: the GTK theme (with all of GTK), virtual keyboard, mock voice."""
_IMAGE_FORMATS = re.compile(r"(?:lib)?q(?:gif|ico|icns|jpeg|svg|webp)\b")
_PLATFORMS = re.compile(r"(?:lib)?q(?:xcb|wayland|windows|cocoa|offscreen|minimal)\b")
_UNUSED = re.compile(
    r"""
    (?:^|/)(?:lib)?Qt6?(?:3D|Bluetooth|Charts|DataVisualization|Designer|Graphs|Help|Labs|Location|Nfc|
    Quick3D|QuickControls2|QuickDialogs2|QuickEffects|QuickLayouts|QuickParticles|QuickShapes|
    QuickTemplates2|QuickTest|QuickTimeline|QuickVectorImage|RemoteObjects|Scxml|Sensors|SerialBus|SerialPort|
    ShaderTools|SpatialAudio|Sql|StateMachine|Test|UiTools|VirtualKeyboard|WebSockets|WebView|
    EglFS|EglFs|FFmpegStub|MultimediaQuick|MultimediaWidgets|PdfQuick|PositioningQuick|QmlCore|
    QmlLocalStorage|QmlNetwork|QmlXmlListModel|WaylandCompositor|WaylandEglCompositorHwIntegration|
    WebChannelQuick|WebEngineQuick|Xml)[\w.-]*$
    """,
    re.VERBOSE,
)


_SYSTEM_LIBRARIES = re.compile(
    r"""
    ^lib(?:stdc\+\+|gcc_s|
    X11|X11-xcb|Xau|Xdmcp|Xext|Xfixes|Xrender|drm|gbm|epoxy|fontconfig|freetype|harfbuzz|fribidi|thai|datrie|
    graphite2|pixman-1|expat|png16|jpeg|
    glib-2|gio-2|gobject-2|gmodule-2|gthread-2|gdk_pixbuf-2|gtk-3|gdk-3|atk-\S+|atspi|cairo|cairo-gobject|pango\S*|
    pcre2-8|mount|blkid|selinux|uuid|dbus-1|systemd|udev|cap|bsd|md|
    asound|pulse|pulsecommon-\S+|asyncns|sndfile|FLAC|ogg|opus|vorbis\w*|mp3lame|mpg123|
    cups|avahi-\w+|gnutls|p11-kit|gcrypt|gpg-error|unistring|idn2|tasn1|nettle|hogweed|gmp|speechd)[.-][\d.-]*so\b
    """,
    re.VERBOSE,
)
"""Libraries of Linux desktops that must not be bundled; the package depends on them (installers/linux).
Bundled copies wouldn't match the computer's graphics driver, fonts or printers.
"""


_BUILD_METADATA = frozenset({"direct_url.json", "RECORD"})
"""Metadata files of a distribution that depend on the build machine: source folder and checksums."""


def is_wanted(name: str) -> bool:
    """Return True if a collected file goes into the package.

    Args:
        name: Path below the frozen program's folder, with slashes or backslashes.
    """
    path = PurePosixPath(name.replace("\\", "/"))
    parts = path.parts
    # Test all parts: a macOS framework is a folder of this name, and a partial one can't be signed.
    if any(_UNUSED.search(part) for part in parts) or _SYSTEM_LIBRARIES.match(str(path)):
        return False
    if _QT_FFMPEG.match(path.name) and ("PySide6" in parts or len(parts) == 1):
        return False
    if parts[:1] == ("pyqtgraph",):
        return not {*UNUSED_OF_PYQTGRAPH, "maps"} & set(parts[1:3])  # the colour maps have separate licences
    if parts[:1] == ("zstandard",) and path.name.startswith("_cffi."):
        return False  # second build of the library, for Pythons other than CPython
    if parts[:2] == ("cv2", "data"):
        return path.suffix != ".xml"  # trained classifiers, which aren't used
    if path.name.startswith("opencv_videoio_ffmpeg"):  # Windows; for other systems see film_libraries.py
        return False
    if "PySide6" in parts:
        return _is_wanted_qt_file(path)
    if path.parent.suffix == ".dist-info" and path.name in _BUILD_METADATA:
        return False
    return path.suffix not in {".pyi", ".h", ".pxd", ".a", ".lib"}


def _is_wanted_qt_file(path: PurePosixPath) -> bool:
    parts = path.parts
    if "qml" in parts or path.name.startswith(
        ("qtwebengine_devtools_resources", "v8_context_snapshot.debug")
    ):
        return False
    if path.name.endswith((".debug.bin", ".debug.pak", ".pyi")):
        return False
    if "qtwebengine_locales" in parts:
        return path.stem in _CHROMIUM_LANGUAGES
    if "translations" in parts and path.suffix == ".qm":
        kind, _, language = path.stem.partition("_")
        return kind in {"qtbase", "qt"} and language in _LANGUAGES
    if "plugins" in parts:
        return _is_wanted_plugin(parts[parts.index("plugins") + 1 :])
    return True


def _is_wanted_plugin(parts: tuple[str, ...]) -> bool:
    folder, name = parts[0], parts[-1]
    if folder == "imageformats":
        return _IMAGE_FORMATS.match(name) is not None
    if folder == "platforms":
        return _PLATFORMS.match(name) is not None
    return folder in _PLUGINS and _NOT_PLUGINS.match(name) is None
