"""Tests of the desktop portal's file dialogs, used only where the portal responds."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from app.ui.startup.portal import PORTAL_THEME, THEME_VARIABLE, has_bus, has_system_dialogs, use_portal

BUS = {"DBUS_SESSION_BUS_ADDRESS": "unix:path=/nowhere"}
FAKE = """
import sys
from PySide6.QtCore import ClassInfo, Property, QCoreApplication, QObject
from PySide6.QtDBus import QDBusAbstractAdaptor, QDBusConnection
app = QCoreApplication([])
@ClassInfo({"D-Bus Interface": "org.freedesktop.portal.FileChooser"})
class Chooser(QDBusAbstractAdaptor):
    version = Property(int, lambda self: 3)
desk = QObject()
chooser = Chooser(desk)
bus = QDBusConnection.sessionBus()
assert bus.registerObject("/org/freedesktop/portal/desktop", desk)
assert bus.registerService("org.freedesktop.portal.Desktop")
print("up", flush=True)
app.exec()
"""
ASK = """
from app.ui.startup import portal
portal.REPLY_TIMEOUT_MS = 60_000  # a busy computer replies late
print(portal.has_file_chooser())
"""
BOTH = """
import subprocess, sys
def ask():
    return subprocess.run([sys.executable, "-c", sys.argv[2]], capture_output=True, text=True, check=True)
before = ask()
portal = subprocess.Popen([sys.executable, "-c", sys.argv[1]], stdout=subprocess.PIPE, text=True)
portal.stdout.readline()
after = ask()
portal.kill()
portal.wait()
print(before.stdout.strip(), after.stdout.strip(), before.stderr, after.stderr)
"""


def chosen(environ: dict[str, str], platform: str, *, answers: bool = True) -> tuple[str, int]:
    """Return the selected platform theme and the number of portal queries."""
    asked = []

    def answer() -> bool:
        asked.append(1)
        return answers

    use_portal(environ, platform, answer)
    return environ.get(THEME_VARIABLE, ""), len(asked)


def test_responding_desktop_portal_is_used_on_linux_only() -> None:
    assert chosen(dict(BUS), "linux") == (PORTAL_THEME, 1)
    assert chosen(dict(BUS), "linux", answers=False) == ("", 1)
    assert chosen(dict(BUS), "win32") == ("", 0)
    assert chosen(dict(BUS), "darwin") == ("", 0)


def test_platform_theme_set_by_the_user_is_kept_without_a_portal_query() -> None:
    assert chosen({**BUS, THEME_VARIABLE: "kde"}, "linux") == ("kde", 0)


def test_portal_is_not_queried_without_a_session_bus(tmp_path: Path) -> None:
    assert chosen({}, "linux") == ("", 0)
    assert chosen({"XDG_RUNTIME_DIR": str(tmp_path)}, "linux") == ("", 0)
    (tmp_path / "bus").write_text("")
    assert not has_bus({"XDG_RUNTIME_DIR": str(tmp_path)}), "a file is no bus"


def test_system_dialogs_are_available_on_windows_macos_and_with_a_portal() -> None:
    assert has_system_dialogs({}, "win32")
    assert has_system_dialogs({}, "darwin")
    assert has_system_dialogs({THEME_VARIABLE: PORTAL_THEME}, "linux")
    assert not has_system_dialogs({}, "linux")


@pytest.mark.skipif(shutil.which("dbus-run-session") is None, reason="needs dbus-run-session (package dbus)")
def test_file_chooser_portal_is_detected_on_a_real_session_bus_without_error_output() -> None:
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).resolve().parents[3])}
    command = ["dbus-run-session", "--", sys.executable, "-c", BOTH, FAKE, ASK]
    said = subprocess.run(command, capture_output=True, text=True, check=True, env=environ).stdout
    assert said.split() == ["False", "True"]
