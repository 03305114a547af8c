"""Functions that find and query a running master, or start one in a separate process."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from typing import TYPE_CHECKING

import zmq

from nep.errors import MasterUnreachable, RequestRefusedError, WireError
from nep.i18n import _
from nep.protocol.encoding import decode_reply, encode_request
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import (
    DoneReply,
    GraphReply,
    Listen,
    Ping,
    QueryGraph,
    RejectedReply,
    Reply,
    Request,
)
from nep.system.addresses import MasterNameResolver, endpoint_of, master_address
from nep.system.descriptors import check_free_descriptors
from nep.system.lazy_import import lazy_module

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

_DESCRIPTORS_NEEDED = 16
_RETRY_INTERVAL_S = 0.5
"""Time in seconds after which an unanswered request is sent again."""

_MAX_REQUEST_TIMEOUT_S = 4.0

NO_CONSOLE: int = getattr(subprocess, "CREATE_NO_WINDOW", 0)
"""`creationflags` with which Windows doesn't open a console window for a subprocess; 0 on other systems."""


class Owner:
    """Process that started a master, identified by pid and start time because the system reuses pids."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        try:
            self._process: psutil.Process | None = psutil.Process(pid)
        except psutil.NoSuchProcess:
            self._process = None

    def is_gone(self) -> bool:
        """Return True if the process has ended."""
        if self._process is None or not self._process.is_running():
            return True
        try:
            return bool(self._process.status() == psutil.STATUS_ZOMBIE)
        except psutil.NoSuchProcess:
            return True


def is_running(address: str | None = None, timeout_s: float = 0.5) -> bool:
    """Return True if a master replies at the address.

    Args:
        address: Address of the master. Default: `master_address`.
        timeout_s: Time limit in seconds.
    """
    resolved_address = master_address(address)
    try:
        return isinstance(_request(Ping(), resolved_address, timeout_s), DoneReply)
    except (MasterUnreachable, RequestRefusedError):
        return False


def view(address: str | None = None, timeout_s: float = 2.0) -> GraphView:
    """Return a snapshot of a master's graph. Doesn't need a node.

    Raises:
        MasterUnreachable: No master replied within `timeout_s` seconds.
        RequestRefusedError: The master rejected the request.
    """
    resolved_address = master_address(address)
    reply = _request(QueryGraph(), resolved_address, timeout_s)
    if not isinstance(reply, GraphReply):
        raise RequestRefusedError(
            _("the master at '{chosen}' didn't reply with its graph").format(chosen=resolved_address)
        )
    return reply.view


def view_or_none(address: str | None = None, timeout_s: float = 0.5) -> GraphView | None:
    """Return a snapshot as `view` does, or None if no compatible master replies in time."""
    resolved_address = master_address(address)
    try:
        return view(resolved_address, timeout_s)
    except (MasterUnreachable, RequestRefusedError):
        return None


def listen(hosts: Sequence[str], address: str | None = None, timeout_s: float = 2.0) -> None:
    """Make the master on this computer serve other computers at these addresses.

    There is no password: every program that reaches such an address can read and send all messages.

    Args:
        hosts: Addresses of this computer; "0.0.0.0" for all. Without any, the master serves only this
            computer.
        address: Address of the master. Default: `master_address`.
        timeout_s: Time limit in seconds.

    Raises:
        RequestRefusedError: The master rejected the request.
        MasterUnreachable: No master replied within `timeout_s` seconds.
    """
    _request(Listen(tuple(hosts)), master_address(address), timeout_s)


def _request(request: Request, address: str, timeout_s: float) -> Reply:
    check_free_descriptors(_DESCRIPTORS_NEEDED, "a connection to the master")
    started = time.monotonic()
    resolver = MasterNameResolver(address, lambda _known: None)
    resolver.resolve(started)
    if not resolver.wait(timeout_s):
        raise MasterUnreachable(address, timeout_s, is_known=False)
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    socket = context.socket(zmq.DEALER)
    try:
        socket.setsockopt(zmq.LINGER, 0)
        socket.setsockopt(zmq.RECONNECT_IVL, 50)
        endpoint, body = endpoint_of(resolver.address), encode_request(request, 1)
        socket.connect(endpoint)
        _send(socket, endpoint, body)
        deadline, retry_at = time.monotonic() + timeout_s, time.monotonic() + _RETRY_INTERVAL_S
        while (remaining_s := deadline - time.monotonic()) > 0:
            if socket.poll(int(min(remaining_s, 0.1) * 1000) + 1):
                reply = _decode_reply(socket.recv())
                if reply is not None:
                    return reply
            # the request may have been sent to a master that was just stopping
            elif time.monotonic() >= retry_at:
                retry_at += _RETRY_INTERVAL_S
                _send(socket, endpoint, body)
        raise MasterUnreachable(address, timeout_s)
    finally:
        socket.close()
        context.term()


def _send(socket: zmq.Socket[bytes], endpoint: str, body: bytes) -> None:
    try:
        socket.send(body, zmq.DONTWAIT)
    except zmq.Again:  # libzmq gave up the connection: the peer was not a master's socket
        socket.disconnect(endpoint)  # else connecting again has no effect
        socket.connect(endpoint)


def _decode_reply(body: bytes) -> Reply | None:
    # None for a push. Raises `RequestRefusedError`.
    try:
        reply = decode_reply(body)[1]
    except WireError as error:
        raise RequestRefusedError(
            _("the master's reply can't be read: {reason}").format(reason=error.reason)
        ) from error
    if isinstance(reply, RejectedReply):
        raise RequestRefusedError(reply.reason)
    return reply if isinstance(reply, Reply) else None


def start_process(
    address: str | None = None,
    owner_pid: int | None = None,
    *,
    command: Sequence[str] | None = None,
    timeout_s: float = 10.0,
) -> subprocess.Popen[bytes]:
    """Start `nep master` in a process that outlives this one, and wait until the master replies.

        process = nep.start_process(owner_pid=os.getpid())

    Args:
        address: Address of the master. Default: `master_address`.
        owner_pid: The master stops when this process has ended and no other program uses the master.
        command: Command line of `nep`. Default: this Python interpreter.
        timeout_s: Time limit of the start in seconds.

    Returns:
        The process.

    Raises:
        MasterUnreachable: The master did not start in time.
    """
    resolved_address = master_address(address)
    arguments = [*(command or (sys.executable, "-m", "nep")), "master"]
    if owner_pid is not None:
        arguments += ["--owner-pid", str(owner_pid)]
    detached = getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0) | NO_CONSOLE
    process = subprocess.Popen(
        arguments,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "NEP_MASTER": resolved_address},
        start_new_session=True,
        creationflags=detached,
    )
    started_s, reply_timeout_s = time.monotonic(), 0.5
    while (remaining_s := started_s + timeout_s - time.monotonic()) > 0 and process.poll() is None:
        if is_running(resolved_address, min(reply_timeout_s, remaining_s)):
            return process
        # a busy computer may need longer for every reply
        reply_timeout_s = min(2 * reply_timeout_s, _MAX_REQUEST_TIMEOUT_S)
    if process.poll() is None:
        process.kill()
    process.wait(5.0)
    raise MasterUnreachable(resolved_address, round(time.monotonic() - started_s, 1))
