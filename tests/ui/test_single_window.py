"""A second start hands its files to the window that runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from PySide6.QtNetwork import QLocalSocket

from app.ui.single_window import Asked, Meeting, hand_over, parse, place

WAIT_MS = 5000
SECOND = """
import sys
from pathlib import Path
from app.ui.single_window import Asked, hand_over
files = tuple(Path(each) for each in sys.argv[2:])
sys.exit(0 if hand_over(sys.argv[1], Asked(files)) else 3)
"""


@pytest.fixture
def name(tmp_path: Path) -> str:
    return place(tmp_path)


def second(name: str, *files: str, cwd: Path) -> subprocess.Popen[bytes]:
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    return subprocess.Popen([sys.executable, "-c", SECOND, name, *files], cwd=cwd, env=environ)


def test_nobody_there_means_a_window_of_its_own(name: str) -> None:
    assert hand_over(name, Asked()) is False


def test_another_process_hands_over_whole_paths(qtbot, name: str, tmp_path: Path) -> None:
    asked: list[Asked] = []
    meeting = Meeting(name, asked.append)
    assert meeting.open
    process = second(name, "a.nepb", str(tmp_path / "Grüße.nepb"), cwd=tmp_path)
    qtbot.waitUntil(lambda: process.poll() is not None, timeout=WAIT_MS)
    assert process.returncode == 0
    assert asked == [Asked((tmp_path / "a.nepb", tmp_path / "Grüße.nepb"))]
    meeting.close()
    assert hand_over(name, Asked()) is False


def test_the_second_window_does_not_take_the_place_of_the_first(qtbot, name: str, tmp_path: Path) -> None:
    asked: list[Asked] = []
    first = Meeting(name, asked.append)
    later = Meeting(name, asked.append)
    assert (first.open, later.open) == (True, False)
    process = second(name, cwd=tmp_path)
    qtbot.waitUntil(lambda: process.poll() is not None, timeout=WAIT_MS)
    assert asked == [Asked()]
    first.close()


@pytest.mark.skipif(os.name != "posix", reason="a named pipe goes with its process")
def test_what_a_killed_studio_left_is_no_hindrance(qtbot, name: str) -> None:
    code = "import sys; from app.ui.single_window import *; m = Meeting(sys.argv[1], print); "
    code += "print(m.open, flush=True); sys.stdin.read()"
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    process = subprocess.Popen(
        [sys.executable, "-c", code, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environ
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"True\n"
    process.kill()
    process.communicate()
    assert Path(name).exists(), "its socket is still there"
    meeting = Meeting(name, lambda _asked: None)
    assert meeting.open
    meeting.close()


def test_nonsense_is_no_start(qtbot, name: str) -> None:
    asked: list[Asked] = []
    meeting = Meeting(name, asked.append)
    for data in (b"{\n", b"[]\n", b'{"files": "x"}\n', b"[" * 200_000 + b"\n", b"x" * 1_100_000):
        socket = QLocalSocket()
        socket.connectToServer(name)
        assert socket.waitForConnected(WAIT_MS)
        socket.write(data)
        qtbot.waitUntil(lambda s=socket: s.state() == s.LocalSocketState.UnconnectedState, timeout=WAIT_MS)
    assert asked == []
    meeting.close()


def test_only_this_user_reaches_the_window(qtbot, name: str) -> None:
    meeting = Meeting(name, lambda _asked: None)
    if os.name == "posix":
        assert Path(name).stat().st_mode & 0o077 == 0
    meeting.close()


def test_a_folder_with_a_long_name_has_a_place_too(tmp_path: Path) -> None:
    deep = tmp_path / ("x" * 120)
    assert place(deep).startswith("nep-studio-")
    assert place(deep) != place(tmp_path / ("y" * 120))


def test_a_start_is_read() -> None:
    assert parse(b'{"files": ["/a.nepb"], "demo": true}') == Asked((Path("/a.nepb"),), True)
    assert parse(b"\xff") is None
