"""Tests of the single instance: a second start passes its files to the running window."""

from __future__ import annotations

import os
import socket as socket_module
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import QObject
from PySide6.QtNetwork import QLocalSocket
from PySide6.QtWidgets import QApplication

from app.core.storage.file_lock import FileLock
from app.ui.startup import single_instance
from app.ui.startup.single_instance import (
    SingleInstanceServer,
    StartRequest,
    is_own_socket,
    parse,
    pass_to_running,
    peer_user,
    send_request,
    socket_name,
)

WAIT_MS = 60_000
SECOND = """
import sys
from pathlib import Path
from app.ui.startup import single_instance
from app.ui.startup.single_instance import StartRequest, send_request
single_instance.CONNECT_TIMEOUT_MS = single_instance.REPLY_TIMEOUT_MS = 60_000  # a busy computer replies late
files = tuple(Path(each) for each in sys.argv[2:])
sys.exit(0 if send_request(sys.argv[1], StartRequest(files)) else 3)
"""


def meet(name: str, do: Callable[[StartRequest], object]) -> SingleInstanceServer:
    """Return a server with a Qt parent, as in Studio; without one it could be deleted while disconnecting."""
    return SingleInstanceServer(name, do, QApplication.instance())


@pytest.fixture
def name(tmp_path: Path) -> str:
    return socket_name(tmp_path)


def second(name: str, *files: str, cwd: Path) -> subprocess.Popen[bytes]:
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    return subprocess.Popen([sys.executable, "-c", SECOND, name, *files], cwd=cwd, env=environ)


def test_start_request_is_not_sent_without_a_running_instance(name: str) -> None:
    assert send_request(name, StartRequest()) is False


def test_second_process_passes_absolute_paths_to_the_running_instance(
    qtbot, name: str, tmp_path: Path
) -> None:
    asked: list[StartRequest] = []
    meeting = meet(name, asked.append)
    assert meeting.is_listening
    process = second(name, "a.nepb", str(tmp_path / "Grüße.nepb"), cwd=tmp_path)
    qtbot.waitUntil(lambda: process.poll() is not None, timeout=WAIT_MS)
    assert process.returncode == 0
    assert asked == [StartRequest((tmp_path / "a.nepb", tmp_path / "Grüße.nepb"))]
    meeting.close()
    assert send_request(name, StartRequest()) is False


STARTING = """
import sys
from pathlib import Path
from app.core.storage.file_lock import FileLock
from app.ui.startup import single_instance
from app.ui.startup.single_instance import StartRequest, pass_to_running
single_instance.CONNECT_TIMEOUT_MS = single_instance.REPLY_TIMEOUT_MS = 60_000
print("begun", flush=True)
turn = FileLock(Path(sys.argv[2]))
there = pass_to_running(sys.argv[1], StartRequest((Path("a.nepb"),)), turn, 60.0)
print("passed" if there else "first", flush=True)
sys.stdin.read()
"""


def starting(name: str, turn: Path) -> subprocess.Popen[str]:
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    return subprocess.Popen(
        [sys.executable, "-c", STARTING, name, str(turn)],
        env=environ,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )


def test_second_of_two_simultaneous_starts_waits_for_the_window_of_the_first(
    qtbot, name: str, tmp_path: Path
) -> None:
    turn, asked = FileLock(tmp_path / "starting"), []
    assert not pass_to_running(name, StartRequest(), turn)
    process = starting(name, tmp_path / "starting")
    assert process.stdout is not None
    assert process.stdout.readline() == "begun\n"
    meeting = meet(name, asked.append)
    qtbot.waitUntil(lambda: bool(asked), timeout=12 * WAIT_MS)
    assert process.communicate(timeout=60)[0] == "passed\n"
    meeting.close()
    turn.release()


def test_start_does_not_wait_for_an_earlier_start_that_was_killed(name: str, tmp_path: Path) -> None:
    turn = FileLock(tmp_path / "starting")
    process = starting(name, tmp_path / "starting")
    assert process.stdout is not None
    assert [process.stdout.readline() for _ in range(2)] == ["begun\n", "first\n"]
    assert not turn.acquire()
    process.kill()
    process.communicate(timeout=60)
    assert not pass_to_running(name, StartRequest(), turn, 60.0)
    assert not FileLock(tmp_path / "starting").acquire(), "it has the turn"
    turn.release()


def test_second_window_does_not_replace_the_single_instance_server(qtbot, name: str, tmp_path: Path) -> None:
    asked: list[StartRequest] = []
    first = meet(name, asked.append)
    later = meet(name, asked.append)
    assert (first.is_listening, later.is_listening) == (True, False)
    process = second(name, cwd=tmp_path)
    qtbot.waitUntil(lambda: process.poll() is not None, timeout=WAIT_MS)
    assert asked == [StartRequest()]
    first.close()


@pytest.mark.skipif(os.name != "posix", reason="a named pipe goes with its process")
def test_stale_socket_of_a_killed_studio_is_replaced(qtbot, name: str) -> None:
    code = "import sys; from app.ui.startup.single_instance import *; "
    code += (
        "m = SingleInstanceServer(sys.argv[1], print); print(m.is_listening, flush=True); sys.stdin.read()"
    )
    environ = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    process = subprocess.Popen(
        [sys.executable, "-c", code, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environ
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"True\n"
    process.kill()
    process.communicate()
    assert Path(name).exists(), "its socket is still there"
    meeting = meet(name, lambda _asked: None)
    assert meeting.is_listening
    meeting.close()


def test_malformed_start_request_is_rejected(qtbot, name: str) -> None:
    asked: list[StartRequest] = []
    meeting = meet(name, asked.append)
    for data in (b"{\n", b"[]\n", b'{"files": "x"}\n', b"[" * 200_000 + b"\n", b"x" * 1_100_000):
        socket = QLocalSocket()
        socket.connectToServer(name)
        assert socket.waitForConnected(WAIT_MS)
        socket.write(data)
        qtbot.waitUntil(lambda s=socket: s.state() == s.LocalSocketState.UnconnectedState, timeout=WAIT_MS)
    assert asked == []
    meeting.close()


def test_socket_is_accessible_to_the_same_user_only(qtbot, name: str) -> None:
    meeting = meet(name, lambda _asked: None)
    if os.name == "posix":
        assert Path(name).stat().st_mode & 0o077 == 0
    meeting.close()


@pytest.fixture
def runtime(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Runtime folder of the user, with a short name because the length of socket names is limited."""
    with tempfile.TemporaryDirectory(prefix="run") as made:
        monkeypatch.setenv("XDG_RUNTIME_DIR", made)
        monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
        yield Path(made)


needs_modes = pytest.mark.skipif(os.name != "posix", reason="Windows has pipes with rights")


@needs_modes
def test_socket_is_in_the_runtime_folder_with_one_per_studio_folder(runtime: Path, tmp_path: Path) -> None:
    one, other = Path(socket_name(tmp_path / "a")), Path(socket_name(tmp_path / "b"))
    assert one.parent == other.parent == runtime / "nep-studio"
    assert one != other
    assert one.parent.stat().st_mode & 0o777 == 0o700
    deep = Path(socket_name(tmp_path / ("x" * 120)))
    assert deep.parent == one.parent


@needs_modes
@pytest.mark.parametrize("wrong", ["open", "linked", "missing", "relative"])
def test_runtime_folder_that_is_linked_missing_relative_or_open_to_others_is_not_used(
    runtime: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong: str
) -> None:
    home = runtime / "home"  # short, because `tmp_path` of an xdist worker is too long for a socket path
    if wrong == "open":
        runtime.chmod(0o777)
    elif wrong == "linked":
        (tmp_path / "link").symlink_to(runtime)
        monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "link"))
    else:
        monkeypatch.setenv("XDG_RUNTIME_DIR", "run" if wrong == "relative" else str(tmp_path / "none"))
    found = Path(socket_name(home))
    assert found.parent == home
    assert home.stat().st_mode & 0o777 == 0o700


@needs_modes
def test_without_a_private_folder_studio_starts_without_a_socket(
    runtime: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The folders belong to another user."""
    monkeypatch.setattr(os, "geteuid", lambda: 4242)
    assert socket_name(tmp_path) == ""
    assert send_request("", StartRequest()) is False
    assert SingleInstanceServer("", lambda _asked: None).is_listening is False


@needs_modes
def test_file_that_is_not_a_socket_of_this_user_is_not_connected_to(
    qtbot, runtime: Path, tmp_path: Path
) -> None:
    name = socket_name(tmp_path)
    os.mkfifo(name)
    assert send_request(name, StartRequest()) is False
    meeting = meet(name, lambda _asked: None)
    assert meeting.is_listening, "what is left in our own folder is ours to take away"
    assert is_own_socket(name)
    Path(name).parent.chmod(0o777)
    assert send_request(name, StartRequest()) is False
    meeting.close()


@needs_modes
def test_connection_of_another_user_is_rejected(qtbot, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[StartRequest] = []
    meeting = meet(name, asked.append)
    monkeypatch.setattr(single_instance, "peer_user", lambda _descriptor: os.geteuid() + 1)
    assert send_request(name, StartRequest()) is False
    socket = QLocalSocket()
    socket.connectToServer(name)
    socket.waitForConnected(WAIT_MS)
    socket.write(b'{"files": [], "demo": true}\n')
    qtbot.waitUntil(lambda: socket.state() == socket.LocalSocketState.UnconnectedState, timeout=WAIT_MS)
    assert asked == []
    meeting.close()


@pytest.mark.skipif(sys.platform not in {"linux", "darwin"}, reason="the system does not tell")
def test_peer_user_id_is_reported_by_the_system(tmp_path: Path) -> None:
    ours, theirs = socket_module.socketpair()
    with ours, theirs:
        assert peer_user(ours.fileno()) == os.geteuid()
    with (tmp_path / "file").open("wb") as file:
        assert peer_user(file.fileno()) is None


@needs_modes
def test_unresponsive_instance_does_not_block_a_start(qtbot, name: str, monkeypatch) -> None:
    monkeypatch.setattr(single_instance, "REPLY_TIMEOUT_MS", 50)
    code = "import socket, sys\ns = socket.socket(socket.AF_UNIX)\ns.bind(sys.argv[1])\ns.listen()\n"
    code += "print('up', flush=True)\nc, _ = s.accept()\nsys.stdin.read()\n"
    process = subprocess.Popen(
        [sys.executable, "-c", code, name], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    assert process.stdout is not None
    assert process.stdout.readline() == b"up\n"
    assert send_request(name, StartRequest()) is False
    process.kill()
    process.communicate()


def test_start_request_is_parsed_or_rejected() -> None:
    assert parse(b'{"files": ["/a.nepb"], "demo": true}') == StartRequest((Path("/a.nepb"),), True)
    assert parse(b"\xff") is None


def test_closing_the_window_during_a_later_start_raises_no_error(
    qtbot, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Qt deletes the connection with the window and emits `disconnected` during the deletion."""
    raised: list[BaseException] = []
    monkeypatch.setattr(sys, "excepthook", lambda _kind, error, _trace: raised.append(error))
    window = QObject()
    meeting = SingleInstanceServer(name, lambda _asked: None, window)
    line = QLocalSocket()
    line.connectToServer(name)
    assert line.waitForConnected(WAIT_MS)
    qtbot.waitUntil(lambda: bool(meeting._buffers), timeout=WAIT_MS)
    with qtbot.waitSignal(window.destroyed, timeout=WAIT_MS):
        window.deleteLater()
    qtbot.waitUntil(lambda: line.state() == QLocalSocket.LocalSocketState.UnconnectedState, timeout=WAIT_MS)
    assert raised == []
