"""Single instance: a second start passes its files to the running Studio and exits.

The processes communicate by a local socket in a private folder, and each checks that the other belongs
to the same user. The option ``--new-window`` starts an independent instance.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import socket
import stat
import struct
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject
from shiboken6 import isValid

from app.core.storage.atomic_file import create_private_folder
from app.core.storage.file_lock import FileLock
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    from PySide6 import QtNetwork
else:
    QtNetwork = lazy_module("PySide6.QtNetwork")

CONNECT_TIMEOUT_MS = 300
REPLY_TIMEOUT_MS = 3000
START_TIMEOUT_S, POLL_S = 20.0, 0.05
MAX_REQUEST_LENGTH = 1_000_000
MAX_PATH_LENGTH = 100  # the path of a Unix socket has at most 108 bytes
OK_REPLY = b"ok\n"


@dataclass(frozen=True)
class StartRequest:
    """Request of a later start to the running instance.

    Attributes:
        files: Files to open.
        starts_demo: True to start the demonstration.
    """

    files: tuple[Path, ...] = ()
    starts_demo: bool = False


def socket_name(folder: Path) -> str:
    """Return the name of the local socket for a folder of Studio.

    Returns "" if there is no private folder for the socket.

    The socket is in the user's runtime folder, else in Studio's folder, else in a private temporary
    folder. In a shared folder, another user could impersonate the running instance.
    """
    folder_hash = hashlib.sha256(os.fsencode(folder.resolve())).hexdigest()[:16]
    if os.name != "posix":
        return f"nep-studio-{folder_hash}"  # a named pipe that only this user may open
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    runtime_folders = (
        [Path(runtime) / "nep-studio"] if Path(runtime).is_absolute() and is_private(Path(runtime)) else []
    )
    for candidate in (
        *runtime_folders,
        folder.resolve(),
        Path(tempfile.gettempdir()) / f"nep-studio-{os.geteuid()}",
    ):
        path = candidate / f"window-{folder_hash}.socket"
        if len(os.fsencode(path)) >= MAX_PATH_LENGTH:
            continue
        with contextlib.suppress(OSError):
            create_private_folder(candidate)
            if is_private(candidate):
                return str(path)
    return ""


def is_private(folder: Path) -> bool:
    """Return True if a folder belongs to this user and nobody else has access.

    Symbolic links are rejected.
    """
    try:
        status = folder.lstat()
    except OSError:
        return False
    return stat.S_ISDIR(status.st_mode) and status.st_uid == os.geteuid() and not status.st_mode & 0o077


def is_own_socket(name: str) -> bool:
    """Return True if a socket exists in a private folder and belongs to this user.

    On Windows, only this user may open the named pipe, so every name except "" is accepted.
    """
    if os.name != "posix":
        return bool(name)
    try:
        status = Path(name).lstat()
    except OSError:
        return False
    return stat.S_ISSOCK(status.st_mode) and status.st_uid == os.geteuid() and is_private(Path(name).parent)


def peer_user(descriptor: int) -> int | None:
    """Return the user id of the peer of a local socket, or None if it can't be determined.

    Args:
        descriptor: File descriptor of the socket.
    """
    peer_option = getattr(socket, "SO_PEERCRED", None)
    descriptor_copy = os.dup(descriptor)
    try:
        socket_copy = socket.socket(fileno=descriptor_copy)
    except OSError:
        os.close(descriptor_copy)
        return None
    try:
        with socket_copy:
            if peer_option is not None:  # Linux: pid, user, group
                return int(struct.unpack("3i", socket_copy.getsockopt(socket.SOL_SOCKET, peer_option, 12))[1])
            if sys.platform == "darwin":  # xucred: version, user, ...; SOL_LOCAL is 0, LOCAL_PEERCRED 1
                return int(struct.unpack_from("2I", socket_copy.getsockopt(0, 1, 76))[1])
    except (OSError, struct.error):
        return None
    return None


def send_request(name: str, request: StartRequest) -> bool:
    """Send a request to the running instance. Blocks for about 3 s at most.

    Args:
        name: Name of the socket; a socket of another user is ignored.
        request: Request.

    Returns:
        True if the instance accepted the request; False if there is none or it doesn't reply in time.
    """
    if not is_own_socket(name):
        return False  # checked on Unix before Qt's network module is loaded, which takes time
    client = QtNetwork.QLocalSocket()
    client.connectToServer(name)
    if not client.waitForConnected(CONNECT_TIMEOUT_MS) or _belongs_to_other_user(client):
        return False
    files = [str(path.absolute()) for path in request.files]
    client.write(json.dumps({"files": files, "demo": request.starts_demo}).encode() + b"\n")
    client.flush()
    reply, deadline = b"", time.monotonic() + REPLY_TIMEOUT_MS / 1000
    while len(reply) < len(OK_REPLY) and (remaining_ms := int((deadline - time.monotonic()) * 1000)) > 0:
        if not client.waitForReadyRead(remaining_ms):
            break
        reply += client.readAll().data()
    client.disconnectFromServer()
    return reply == OK_REPLY


def pass_to_running(
    name: str, request: StartRequest, lock: FileLock, timeout_s: float = START_TIMEOUT_S
) -> bool:
    """Send a request to a running instance, or to one that is just starting.

    Args:
        name: Name of the socket.
        request: Request.
        lock: Lock of the instance that is starting.
        timeout_s: Maximum time in seconds to wait for an instance that is starting.

    Returns:
        True if an instance accepted the request. False if this process must open a window. It then
        holds `lock`, unless the time limit was exceeded or `name` is empty; release the lock when the
        window can receive requests.
    """
    deadline, pause, has_waited = time.monotonic() + timeout_s, threading.Event(), False
    while not send_request(name, request):
        if not name or time.monotonic() >= deadline:
            return False
        if lock.acquire():
            if has_waited and send_request(name, request):  # the window appeared between the two attempts
                lock.release()
                return True
            return False
        has_waited = True
        pause.wait(POLL_S)
    return True


def _belongs_to_other_user(client: QtNetwork.QLocalSocket) -> bool:
    if os.name != "posix":
        return False
    user = peer_user(int(client.socketDescriptor()))
    return user is not None and user != os.geteuid()


class SingleInstanceServer(QObject):
    """Server that receives the requests of later starts until it is closed."""

    def __init__(
        self, name: str, on_request: Callable[[StartRequest], object], parent: QObject | None = None
    ) -> None:
        # `on_request` is called with each request.
        super().__init__(parent)
        self._on_request = on_request
        self._buffers: dict[QtNetwork.QLocalSocket, bytes] = {}
        self._server = QtNetwork.QLocalServer(self)
        self._server.setSocketOptions(QtNetwork.QLocalServer.SocketOption.UserAccessOption)
        self._server.newConnection.connect(self._accept)
        self.is_listening = self._listen(name)
        """True if later starts can reach this window; otherwise each opens its own."""

    def _listen(self, name: str) -> bool:
        if not name:
            return False
        # On Unix a second listener replaces the first one silently, so check first whether there is one.
        probe = QtNetwork.QLocalSocket()
        probe.connectToServer(name)
        if probe.waitForConnected(CONNECT_TIMEOUT_MS):
            probe.disconnectFromServer()
            return False
        if self._server.listen(name):
            return True
        QtNetwork.QLocalServer.removeServer(name)  # left behind by an instance that was killed
        return self._server.listen(name)

    def _accept(self) -> None:
        while (socket := self._server.nextPendingConnection()) is not None:
            if _belongs_to_other_user(socket):
                socket.abort()
                socket.deleteLater()
                continue
            self._buffers[socket] = b""
            socket.readyRead.connect(lambda socket=socket: self._read(socket))
            socket.disconnected.connect(lambda socket=socket: self._on_disconnected(socket))
            self._read(socket)

    def _read(self, socket: QtNetwork.QLocalSocket) -> None:
        if socket not in self._buffers:
            return
        self._buffers[socket] += socket.readAll().data()
        data = self._buffers[socket]
        if len(data) > MAX_REQUEST_LENGTH:
            socket.abort()
        elif data.endswith(b"\n"):
            self._buffers[socket] = b""
            request = parse(data)
            if request is None:
                socket.abort()
                return
            socket.write(OK_REPLY)
            socket.flush()
            self._on_request(request)

    def _on_disconnected(self, socket: QtNetwork.QLocalSocket) -> None:
        self._buffers.pop(socket, None)
        if isValid(socket):  # the socket may have been deleted with the window
            socket.deleteLater()

    def close(self) -> None:
        """Stop the server."""
        self._server.close()


def parse(data: bytes) -> StartRequest | None:
    """Parse a request, encoded as JSON; return None if it is malformed."""
    try:
        content = json.loads(data)
    except (ValueError, RecursionError):
        return None
    files = content.get("files") if isinstance(content, Mapping) else None
    if not isinstance(files, Sequence) or isinstance(files, str):
        return None
    return StartRequest(tuple(Path(str(each)) for each in files), content.get("demo") is True)
