"""Tests of the selection of files for a package, with the file names of each system."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from installers.contents import EXCLUDED_MODULES, UNUSED_OF_PYQTGRAPH, is_wanted

WANTED = [
    "PySide6/Qt/lib/libQt6WebEngineCore.so.6",
    "PySide6/Qt/lib/libQt6Widgets.so.6",
    "PySide6/Qt/lib/libQt6Quick.so.6",
    "PySide6/Qt/lib/libQt6QmlModels.so.6",
    "PySide6/Qt/lib/libQt6Multimedia.so.6",
    "PySide6/Qt/libexec/QtWebEngineProcess",
    "PySide6/Qt/plugins/platforms/libqxcb.so",
    "PySide6/Qt/plugins/platforms/libqwayland.so",
    "PySide6/Qt/plugins/imageformats/libqjpeg.so",
    "PySide6/Qt/plugins/texttospeech/libqtexttospeech_speechd.so",
    "PySide6/Qt/resources/icudtl.dat",
    "PySide6/Qt/resources/v8_context_snapshot.bin",
    "PySide6/Qt/translations/qtwebengine_locales/en-US.pak",
    "PySide6/Qt/translations/qtwebengine_locales/es.pak",
    "PySide6/Qt/translations/qtbase_es.qm",
    "PySide6\\plugins\\platforms\\qwindows.dll",
    "PySide6\\plugins\\styles\\qmodernwindowsstyle.dll",
    "PySide6\\Qt6WebEngineCore.dll",
    "PySide6\\QtWebEngineProcess.exe",
    "PySide6/Qt/lib/QtWebEngineCore.framework/Versions/A/QtWebEngineCore",
    "PySide6/Qt/plugins/platforms/libqcocoa.dylib",
    "app/_resources/blockly/editor.js",
    "app/_resources/blockly/index.html",
    "cv2/cv2.abi3.so",
    "opencv_python_headless.libs/libpng16-529cb57a.so.16.58.0",
    "numpy.libs/libscipy_openblas64_-32a4b2a6.so",
    "libpython3.11.so.1.0",
    "libnss3.so",
    "libxcb-cursor.so.0",
    "libcrypto.so.3",
    "libgssapi_krb5.so.2",
    "libbrotlidec.so.1",
    "libsqlite3.so.0",
    "nep_studio-0.1.0.dist-info/METADATA",
    "pyqtgraph/icons/invisibleEye.svg",
    "zstandard/backend_c.cpython-311-x86_64-linux-gnu.so",
    "pyqtgraph-0.14.0.dist-info/METADATA",
]

UNWANTED = [
    "nep_studio-0.1.0.dist-info/direct_url.json",
    "nep_studio-0.1.0.dist-info/RECORD",
    "zstandard/_cffi.cpython-311-x86_64-linux-gnu.so",
    "zstandard\\_cffi.cp311-win_amd64.pyd",
    "PySide6/Qt/lib/libQt63DRender.so.6",
    "PySide6/Qt/lib/libQt6Quick3D.so.6",
    "PySide6/Qt/lib/libQt6Designer.so.6",
    "PySide6/Qt/lib/libavcodec.so.61",
    "libavcodec.so.61",
    "PySide6\\avcodec-61.dll",
    "PySide6/Qt/qml/QtQuick/Controls/Basic/libqtquickcontrols2basicstyleplugin.so",
    "PySide6/Qt/plugins/multimedia/libffmpegmediaplugin.so",
    "PySide6/Qt/plugins/platformthemes/libqgtk3.so",
    "PySide6/Qt/plugins/sqldrivers/libqsqlite.so",
    "PySide6\\plugins\\sqldrivers\\qsqlite.dll",
    "PySide6\\Qt63DCore.dll",
    "PySide6/Qt/plugins/imageformats/libqtiff.so",
    "PySide6/Qt/plugins/platforms/libqvnc.so",
    "PySide6/Qt/resources/qtwebengine_devtools_resources.pak",
    "PySide6/Qt/translations/qtwebengine_locales/de.pak",
    "PySide6/Qt/translations/qtbase_de.qm",
    "PySide6/Qt/translations/designer_es.qm",
    "cv2/data/haarcascade_eye.xml",
    "pyqtgraph/colors/maps/CET-C1.csv",
    "pyqtgraph\\flowchart\\library\\a.ui",
    "pyqtgraph/examples/a.png",
    "cv2\\opencv_videoio_ffmpeg4140_64.dll",
    "libstdc++.so.6",
    "libX11.so.6",
    "libX11-xcb.so.1",
    "libglib-2.0.so.0",
    "libpulsecommon-16.1.so",
    "libatk-bridge-2.0.so.0",
    "libcups.so.2",
    "libfontconfig.so.1",
    "libharfbuzz.so.0",
]


@pytest.mark.parametrize("name", WANTED)
def test_modules_used_by_studio_are_included(name: str) -> None:
    assert is_wanted(name)


PLOT_WITHOUT_THEM = """
import pathlib, sys
sys.modules.update(dict.fromkeys(sys.argv[1:]))
opened = []
sys.addaudithook(lambda event, given: opened.append(given[0]) if event == "open" else None)
from PySide6.QtWidgets import QApplication
application = QApplication([])
import app.ui.panels.watch.plot.panel
from app.ui.panels.watch.plot.canvas import PlotCanvas
from app.ui.theme.theme import Theme
canvas = PlotCanvas(Theme("light"))
canvas.show_lines([], 0.0)
assert not canvas.grab().isNull()
print([name for name in opened if "colors" in str(name) and "maps" in str(name)])
"""


def test_plot_works_without_the_excluded_modules() -> None:
    left_out = [name for name in EXCLUDED_MODULES if name.startswith(("pyqtgraph.", "PySide6.QtTest"))]
    assert len(left_out) == len(UNUSED_OF_PYQTGRAPH) + 1
    command = [sys.executable, "-c", PLOT_WITHOUT_THEM, *left_out]
    environment = {**os.environ, "QT_QPA_PLATFORM": "offscreen"}
    ran = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert (ran.returncode, ran.stdout.strip()) == (0, "[]"), ran.stderr


@pytest.mark.parametrize("name", UNWANTED)
def test_unused_modules_are_excluded(name: str) -> None:
    assert not is_wanted(name)
