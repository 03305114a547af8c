"""OwnedServices: the servers and clients of one node. Part of `Node`."""

from __future__ import annotations

import threading
import time
from typing import cast

from nep.backends.base import Transport
from nep.backends.services import CallQueue, ClientSpec, ServerSpec, ServiceTransport
from nep.errors import NepError
from nep.i18n import _
from nep.messages.codecs import Codec, codec_numbered
from nep.services.client import Client
from nep.services.server import Callback, Server

__all__ = ["OwnedServices"]


class OwnedServices:
    """Makes them through the node's transport, and ends them with the node. May be used from any thread."""

    def __init__(self, transport: Transport, backend: str) -> None:
        self._transport = transport
        self._backend = backend
        self._lock = threading.Lock()
        self._servers: tuple[Server, ...] = ()
        self._clients: tuple[Client, ...] = ()

    def server(self, spec: ServerSpec, callback: Callback | None, threads: int) -> Server:
        """A new server. Raises as the transport does, and `NepError` when that has no services."""
        made = Server(self._able().server(spec), spec.service, callback, threads, self._forget)
        with self._lock:
            self._servers = (*self._servers, made)
        self._transport.wake()  # who spins already answers its calls now
        return made

    def client(self, spec: ClientSpec, timeout_s: float | None) -> Client:
        """A new client. Raises as `server` does."""
        made = Client(self._able().client(spec), spec.service, spec.codec, timeout_s, self._forget)
        with self._lock:
            self._clients = (*self._clients, made)
        return made

    def _able(self) -> ServiceTransport:
        if not hasattr(self._transport, "server"):
            raise NepError(
                _("the back end '{backend}' has no services; use 'zeromq' for them").format(
                    backend=self._backend
                )
            )
        return cast("ServiceTransport", self._transport)

    def _forget(self, closed: Server | Client) -> None:
        with self._lock:
            self._servers = tuple(each for each in self._servers if each is not closed)
            self._clients = tuple(each for each in self._clients if each is not closed)

    # ---- for who spins

    @property
    def queues(self) -> list[CallQueue]:
        """What to wait for."""
        return [queue for each in self._servers if (queue := each.spun) is not None and not each.is_closed]

    def run(self, node_ends: threading.Event) -> bool:
        """One call for each server that has one; whether there was any. Stops when the node does."""
        has_run = False
        for server in self._servers:
            if node_ends.is_set():
                break
            if server.spun is not None and not server.is_closed:
                has_run = server.run_one() or has_run
        return has_run

    # ---- the end

    def finish_calls(self, timeout_s: float) -> None:
        """The transport takes no calls any more: wait for those that threads of the servers carry out."""
        deadline = time.monotonic() + timeout_s
        for server in self._servers:
            server.join(max(0.0, deadline - time.monotonic()))

    def end(self, timeout_s: float) -> None:
        """The transport has closed their sockets: end their threads."""
        deadline = time.monotonic() + timeout_s
        with self._lock:
            servers, self._servers = self._servers, ()
            clients, self._clients = self._clients, ()
        for server in servers:
            server.join(max(0.0, deadline - time.monotonic()))
        for client in clients:
            client.join()

    def forked(self) -> None:
        """In a child that was forked. See `nep.system.forks`."""
        self._lock = threading.Lock()
        for server in self._servers:
            server.forked()
        for client in self._clients:
            client.forked()
        self._servers = self._clients = ()


def codec_checked(codec: Codec) -> Codec:
    """`codec` itself when calls can have it. Raises `NepError`."""
    if codec.name == "image":
        raise NepError(_("a call cannot be a picture; publish it on a topic"))
    if codec_numbered(codec.number) is not codec:  # of a back end's own, which has no number of its own
        raise NepError(_("'{name}' is no type for calls; use 'json' or 'msgpack'").format(name=codec.name))
    return codec
