"""Tests of the error message of Studio when no window can open."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.ui.application import startup_problem

X11 = {"DISPLAY": ":0"}


@pytest.mark.parametrize(
    ("environ", "platform", "user", "said"),
    [
        (X11, "linux", 1000, ""),
        ({"WAYLAND_DISPLAY": "wayland-0"}, "linux", 1000, ""),
        ({"QT_QPA_PLATFORM": "offscreen"}, "linux", 1000, ""),
        ({}, "linux", 1000, "no screen found"),
        ({"DISPLAY": ""}, "linux", 1000, "no screen found"),
        (X11, "linux", 0, "as root"),
        ({**X11, "QTWEBENGINE_DISABLE_SANDBOX": "1"}, "linux", 0, ""),
        ({}, "darwin", 0, ""),
        ({}, "win32", 1, ""),
    ],
)
def test_reason_why_no_window_can_open_is_reported(
    environ: dict[str, str], platform: str, user: int, said: str
) -> None:
    assert said in startup_problem(environ, platform, user)
    assert bool(said) == bool(startup_problem(environ, platform, user))


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="screens have no name elsewhere")
def test_studio_without_a_display_exits_with_a_message(tmp_path: Path) -> None:
    hidden = {"DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM"}
    environ = {name: value for name, value in os.environ.items() if name not in hidden}
    environ["NEP_STUDIO_HOME"] = str(tmp_path)
    command = [sys.executable, "-m", "app"]
    done = subprocess.run(command, env=environ, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("nep-studio: no screen found")
    assert "reinstall" not in done.stderr


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="needs root")
def test_studio_as_root_with_browser_sandbox_exits_with_a_message(tmp_path: Path) -> None:
    environ = {**os.environ, "QT_QPA_PLATFORM": "offscreen", "NEP_STUDIO_HOME": str(tmp_path)}
    environ["NEP_MASTER"] = "127.0.0.1:1"
    for name in ("QTWEBENGINE_DISABLE_SANDBOX", "QTWEBENGINE_CHROMIUM_FLAGS"):
        environ.pop(name, None)
    command = [sys.executable, "-m", "app"]
    done = subprocess.run(command, env=environ, capture_output=True, text=True, check=False, timeout=140)
    assert done.returncode == 2
    assert "can't run as root with its sandbox; start Studio as another user" in done.stderr


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="screens have no name elsewhere")
def test_studio_with_an_unreachable_display_exits_with_a_message(tmp_path: Path) -> None:
    environ = {
        **{name: value for name, value in os.environ.items() if name != "WAYLAND_DISPLAY"},
        "DISPLAY": ":64999",
        "QT_QPA_PLATFORM": "xcb",
        "QTWEBENGINE_DISABLE_SANDBOX": "1",
        "NEP_STUDIO_HOME": str(tmp_path),
    }
    command = [sys.executable, "-m", "app"]
    done = subprocess.run(command, env=environ, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert (
        "no window can open; check that the display exists and accepts connections (DISPLAY is ':64999')"
        in done.stderr
    )
    assert "einstall" not in done.stderr
