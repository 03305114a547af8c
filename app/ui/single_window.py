"""One window for one person: a second start hands its files to the Studio that runs already.

Both meet at a local socket in Studio's folder, which only this user can reach. ``--new-window`` leaves it.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject

from nep.later import later

if TYPE_CHECKING:
    from PySide6 import QtNetwork
else:
    QtNetwork = later("PySide6.QtNetwork")

CONNECT_MS = 300
ANSWER_MS = 3000
LONGEST = 1_000_000
LONGEST_PATH = 100  # a Unix socket's name has 108 bytes at most
OK = b"ok\n"


@dataclass(frozen=True)
class Asked:
    """What a second start asks of the window that is there."""

    files: tuple[Path, ...] = ()
    demo: bool = False


def place(folder: Path) -> str:
    """The name of the socket of Studio's folder."""
    whole = folder.resolve()
    path = str(whole / "window.socket")
    if os.name == "posix" and len(os.fsencode(path)) < LONGEST_PATH:
        return path
    return "nep-studio-" + hashlib.sha256(os.fsencode(whole)).hexdigest()[:24]


def hand_over(name: str, asked: Asked) -> bool:
    """Let the window that runs do it; False when none runs. Waits at most 3 s for its answer."""
    if os.name == "posix" and Path(name).is_absolute() and not Path(name).exists():
        return False  # without Qt's network, which takes its time to load
    socket = QtNetwork.QLocalSocket()
    socket.connectToServer(name)
    if not socket.waitForConnected(CONNECT_MS):
        return False
    files = [str(path.absolute()) for path in asked.files]
    socket.write(json.dumps({"files": files, "demo": asked.demo}).encode() + b"\n")
    socket.flush()
    answer = b""
    while not answer.endswith(b"\n") and socket.waitForReadyRead(ANSWER_MS):
        answer += socket.readAll().data()
    socket.disconnectFromServer()
    return answer == OK


class Meeting(QObject):
    """The place where later starts find this window; `close` leaves it."""

    def __init__(self, name: str, do: Callable[[Asked], object], parent: QObject | None = None) -> None:
        """``do`` is called for each later start."""
        super().__init__(parent)
        self._do = do
        self._heard: dict[QtNetwork.QLocalSocket, bytes] = {}
        self._server = QtNetwork.QLocalServer(self)
        self._server.setSocketOptions(QtNetwork.QLocalServer.SocketOption.UserAccessOption)
        self._server.newConnection.connect(self._come)
        self.open = self._listen(name)
        """Whether later starts can find it; without, each has a window of its own."""

    def _listen(self, name: str) -> bool:
        # On Unix a second listener takes the first one's place without a word: look first who is there.
        probe = QtNetwork.QLocalSocket()
        probe.connectToServer(name)
        if probe.waitForConnected(CONNECT_MS):
            probe.disconnectFromServer()
            return False
        if self._server.listen(name):
            return True
        QtNetwork.QLocalServer.removeServer(name)  # what a Studio that was killed left behind
        return self._server.listen(name)

    def _come(self) -> None:
        while (socket := self._server.nextPendingConnection()) is not None:
            self._heard[socket] = b""
            socket.readyRead.connect(lambda socket=socket: self._read(socket))
            socket.disconnected.connect(lambda socket=socket: self._gone(socket))
            self._read(socket)

    def _read(self, socket: QtNetwork.QLocalSocket) -> None:
        if socket not in self._heard:
            return
        self._heard[socket] += socket.readAll().data()
        data = self._heard[socket]
        if len(data) > LONGEST:
            socket.abort()
        elif data.endswith(b"\n"):
            self._heard[socket] = b""
            asked = parse(data)
            if asked is None:
                socket.abort()
                return
            socket.write(OK)
            socket.flush()
            self._do(asked)

    def _gone(self, socket: QtNetwork.QLocalSocket) -> None:
        self._heard.pop(socket, None)
        socket.deleteLater()

    def close(self) -> None:
        """Nobody finds this window any more."""
        self._server.close()


def parse(data: bytes) -> Asked | None:
    """What a start asked; None for what no Studio sends."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return None
    files = content.get("files") if isinstance(content, Mapping) else None
    if not isinstance(files, Sequence) or isinstance(files, str):
        return None
    return Asked(tuple(Path(str(each)) for each in files), content.get("demo") is True)
