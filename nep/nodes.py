"""Node: a program, or a part of one, with its publishers and subscribers."""

from __future__ import annotations

import atexit
import itertools
import logging
import os
import platform
import secrets
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

import zmq.utils.garbage  # noqa: F401 - its exit hook must be older than ours: it frees what we still send

from nep.addresses import master_address
from nep.backends.base import Carrier, Inlet, PublisherSpec, Sink, SubscriberSpec
from nep.backends.choosing import backend_named
from nep.codecs import codec_for
from nep.configuration import Configuration, Direct, Hybrid, checked_mode, checked_port
from nep.errors import ClosedError, DecodeError
from nep.graph import GraphView
from nep.inbox import MAX_MESSAGES, Keep
from nep.logs import LogHandler, handler_of
from nep.pubsub import SLICE_S, Publisher, Subscriber
from nep.records import NodeRecord
from nep.registration import id_from, node_id_from
from nep.wire import check_node_name, check_topic

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Node"]

FLUSH_S = 2.0
"""How long closing waits for what was published to be delivered."""

_alive: set[Node] = set()
"""Nodes live until they are closed or the interpreter ends: a publisher may outlive its node's variable."""


class Node:
    """A node of this name. It needs no master until something is made on it; works in any thread.

    `transport` names a back end: "zeromq" (also "ZMQ"), "memory" (nodes of this process only). `master` is
    the master's address (default: $NEP_MASTER, else 127.0.0.1:7780). `wait_s`: how long `new_pub` and
    `new_sub` wait for a master before they raise `MasterUnreachable`; None waits for ever. Raises
    `UnknownBackendError` and `BadNameError`.
    """

    def __init__(
        self,
        name: str,
        transport: str = "zeromq",
        *,
        master: str | None = None,
        wait_s: float | None = 2.0,
        generation: str = "native",
    ) -> None:
        self.name = check_node_name(name)
        key = secrets.token_hex(16)
        self.id = node_id_from(key)
        self._key = key
        self._numbers = itertools.count(1)
        self._backend = backend_named(transport)
        self._master = master or ("memory" if self._backend.name == "memory" else master_address())
        if self._backend.name != "memory":
            self._master = master_address(self._master)
        self._wait_s = wait_s
        self._lock = threading.RLock()
        self._stop_spin = threading.Event()
        self._callbacks: tuple[tuple[Subscriber, Inlet, Callable[[Any], object]], ...] = ()
        self._publishers: list[Publisher] = []
        self._is_closed = False
        self._log_handler: LogHandler | None = None
        record = NodeRecord(
            self.id,
            name,
            platform.node(),
            os.getpid(),
            generation=generation,
            since_ns=time.time_ns(),
            key=key,
        )
        self._carrier: Carrier = self._backend.open(record)
        _alive.add(self)

    # ---- how to connect

    def hybrid(
        self,
        master_ip: str = "127.0.0.1",
        mode: str = "many2many",
        transport: str = "",  # noqa: ARG002 - the node's transport is used, as in the original
    ) -> Hybrid:
        """Connected through a master; any number of publishers and subscribers, whatever the mode says.

        "127.0.0.1" means the node's own master.
        """
        is_own = master_ip == "127.0.0.1" or self._backend.name == "memory"
        return Hybrid(self._master if is_own else master_address(master_ip), checked_mode(mode))

    def direct(
        self,
        ip: str = "127.0.0.1",
        port: str | int = "9000",
        mode: str = "one2many",
        transport: str = "",  # noqa: ARG002 - the node's transport is used, as in the original
        *,
        generation: Literal["A", "B"] = "A",
        wire: Literal["original", "native"] = "original",
    ) -> Direct:
        """Connected without a master to `ip:port`; see `Direct` for the modes.

        Sends the frames of the original NEP up to 0.5.4.5, or from 0.5.4.8 on (`generation="B"`), or native
        ones; receives both forms of the original. Raises `NepError` for what is no mode or port.
        """
        return Direct(ip, checked_port(port), checked_mode(mode), generation, wire)

    # ---- publishers and subscribers

    def new_pub(
        self,
        topic: str,
        msg_type: str = "json",
        configuration: Configuration | None = None,
        *,
        latched: bool = False,
    ) -> Publisher:
        """A publisher. The first message reaches every subscriber that was there before this returned.

        `latched`: whoever subscribes later gets the last message at once. Raises `MasterUnreachable`,
        `BadTopicError`, `AddressInUseError`, `ClosedError`.
        """
        number = next(self._numbers)
        spec = PublisherSpec(
            id_from(self._key, number),
            check_topic(topic),
            msg_type,
            codec_for(msg_type),
            latched,
            configuration or self.hybrid(),
            self._wait_s,
            number,
        )
        publisher = Publisher(self._open_carrier().publisher(spec), spec)
        with self._lock:
            self._publishers.append(publisher)
        return publisher

    def new_sub(
        self,
        topic: str,
        msg_type: str = "json",
        configuration: Configuration | None = None,
        *,
        keep: Keep = "all",
        max_messages: int = MAX_MESSAGES,
        sink: Sink | None = None,
    ) -> Subscriber:
        """A subscriber. What is published after this returned arrives, from every registered publisher.

        `keep="latest"`: only the newest message is kept for `listen`; "all": up to `max_messages` (and
        256 MB), then the oldest are dropped and counted. `sink`: takes the messages in batches, 200 times a
        second at most, in the node's own thread, instead of `listen`. Raises as `new_pub` does.
        """
        number = next(self._numbers)
        spec = SubscriberSpec(
            id_from(self._key, number),
            check_topic(topic),
            msg_type,
            configuration or self.hybrid(),
            self._wait_s,
            keep,
            max_messages,
            sink=sink,
            number=number,
        )
        carrier = self._open_carrier()
        return Subscriber(carrier.subscriber(spec), spec)

    def new_callback(
        self,
        topic: str,
        msg_type: str,
        callback: Callable[[Any], object],
        configuration: Configuration | None = None,
    ) -> Subscriber:
        """A subscriber whose payloads are given to `callback`, in the thread that calls `spin`."""
        carrier = self._open_carrier()
        number = next(self._numbers)
        spec = SubscriberSpec(
            id_from(self._key, number),
            check_topic(topic),
            msg_type,
            configuration or self.hybrid(),
            self._wait_s,
            number=number,
        )
        inlet = carrier.subscriber(spec)
        subscriber = Subscriber(inlet, spec)
        with self._lock:
            self._callbacks = (*self._callbacks, (subscriber, inlet, callback))
        return subscriber

    # ---- spinning

    def spin(self, timeout_s: float | None = None) -> None:
        """Run callbacks in this thread until `stop_spin`, `close`, or for `timeout_s` seconds.

        What a callback raises comes out here. A `stop_spin` that came before ends the next spin at once.
        """
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        try:
            while not self._stop_spin.is_set() and not self._is_closed:
                left = SLICE_S if deadline is None else min(SLICE_S, deadline - time.monotonic())
                if left <= 0.0:
                    return
                if not self._run_callbacks():
                    self._carrier.wait([inlet for _sub, inlet, _call in self._callbacks], left)
        finally:
            self._stop_spin.clear()

    def stop_spin(self) -> None:
        """End `spin`, from any thread or from a callback."""
        self._stop_spin.set()
        self._carrier.wake()

    def _run_callbacks(self) -> bool:
        """One message for each callback that has one; whether there was any."""
        worked = False
        for subscriber, inlet, callback in self._callbacks:
            try:
                message = inlet.ready.popleft()
            except IndexError:
                found = None if inlet.is_closed else inlet.poll()
                if found is None:
                    continue
                message = found
            worked = True
            try:
                payload = subscriber.decoded(message)
            except DecodeError:
                continue  # it is logged and an alert
            callback(payload)
            if self._stop_spin.is_set():
                break
        return worked

    # ---- what it tells, the graph, and the end

    @property
    def log(self) -> logging.Logger:
        """A logger whose records, from INFO on, Studio's Console and `nep log` show; see `nep.logs`."""
        return self.log_handler.logger

    @property
    def log_handler(self) -> LogHandler:
        """Publishes records as this node's; add it to a logger to publish all that a program logs."""
        with self._lock:
            self._log_handler = self._log_handler or handler_of(self)
            return self._log_handler

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Who is there now. Raises `MasterUnreachable` when the master does not answer in time."""
        return self._open_carrier().graph(self.hybrid(), timeout_s)

    def close(self, timeout_s: float = FLUSH_S) -> None:
        """Unregister and end; what was published is delivered first, within `timeout_s`. May be called twice.

        What could not be delivered is logged as a warning. Happens by itself when the interpreter ends.
        """
        if self._log_handler is not None:
            self._log_handler.close(timeout_s / 4)
            timeout_s *= 3 / 4
        with self._lock:
            if self._is_closed:
                return
            self._is_closed = True
        _alive.discard(self)
        self._stop_spin.set()
        for publisher in self._publishers:
            publisher._is_closed = True  # noqa: SLF001 - they belong together; the carrier closes all at once
        self._carrier.close(timeout_s)

    def _open_carrier(self) -> Carrier:
        if self._is_closed:
            raise ClosedError(f"node '{self.name}'")
        return self._carrier

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Node({self.name!r}, {self._backend.name!r}, master={self._master!r})"


def _close_all() -> None:
    deadline = time.monotonic() + FLUSH_S
    for each in tuple(_alive):
        each.close(max(0.0, deadline - time.monotonic()))


atexit.register(_close_all)
