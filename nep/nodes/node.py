"""Node: a program, or a part of one, with its publishers and subscribers."""

from __future__ import annotations

import atexit
import itertools
import logging
import os
import platform
import secrets
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import zmq.utils.garbage  # noqa: F401 - its exit hook must be older than ours: it frees what we still send

import nep.system.exits  # noqa: F401 - so must this one's
from nep.backends.base import (
    PublisherSpec,
    Sink,
    SubscriberSpec,
    SubscriberTransport,
    Transport,
    backend_named,
)
from nep.backends.connection import Configuration, Direct, Hybrid, checked_mode, checked_port, for_messages
from nep.errors import BadTopicError, ClosedError, WrongTypeError
from nep.i18n import _
from nep.messages.image_codec import ImageFormat
from nep.messages.queue import MAX_MESSAGES, Keep
from nep.nodes.abilities import codec_with, history_for, is_pattern_for, quality_for
from nep.nodes.arguments import at_least, flag, function, limit, one_of, period, seconds, text
from nep.nodes.async_spinning import spin as spin_in_loop
from nep.nodes.executor import spin_all
from nep.nodes.log_handler import LogHandler, handler_of
from nep.nodes.publisher import Publisher
from nep.nodes.subscriber import Subscriber
from nep.nodes.timer import Timer
from nep.nodes.typed import MsgType, codec_of, name_of, new_subscriber, sink_of
from nep.nodes.work import Callback, Work
from nep.patterns.parameters.owned import MSG_TYPE, Parameters, place_of
from nep.patterns.parameters.remote import RemoteParameters, node_with_parameters
from nep.patterns.services.owned import OwnedServices
from nep.patterns.services.service_node import ServiceNode
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import NodeRecord, id_from, node_id_from
from nep.protocol.service_wire import PREFIX
from nep.protocol.wire import check_node_name, check_topic
from nep.system import forks
from nep.system.addresses import checked_host
from nep.system.computer import computer_id

if TYPE_CHECKING:
    from typing_extensions import Self

__all__ = ["Node", "spin"]

FLUSH_S = 2.0
"""How long closing waits for what was published to be delivered."""

_WORKER_PRIORITY = 10
"""0 and more: before a worker waits for processes of its own, which may need what was published."""

_alive: set[Node] = set()
"""Nodes live until they are closed or the interpreter ends: a publisher may outlive its node's variable."""
_inherited: list[Node] = []
"""Nodes of the process that forked this one: closed, and kept, because nothing of them may be touched."""
_closed_in = 0
"""The process in which `multiprocessing` knows that nodes are to be closed."""


class Node(ServiceNode):
    """A node of this name. It needs no master until something is made on it; works in any thread.

    `name`: what others see it as; it may be there more than once, which is an alert. `transport`: the back
    end, "zeromq" (also "ZMQ"), "memory" (nodes of this process only), "zenoh", "nanomsg", "ros" or "ros2"
    (docs/backends.md). `master`: the master's address (default: $NEP_MASTER, else 127.0.0.1:7780). `wait_s`:
    how long `new_pub` and `new_sub` wait for a master before they raise `MasterUnreachable`; None waits for
    ever. `generation`: what it is in the graph, another word for gateways to other systems. `language`: the
    language of its program in the graph; "web" for the web pages of `nep web`. `strict`: its publishers raise
    `EncodeError` for whatever cannot be sent, see `Publisher.publish`. Raises `UnknownBackendError`,
    `BackendUnavailableError`, `BadNameError`, `TooManyFilesError`. In a child that is forked it is closed,
    with all that was made on it; a new node works there.
    """

    def __init__(
        self,
        name: str,
        transport: str = "zeromq",
        *,
        master: str | None = None,
        wait_s: float | None = 2.0,
        generation: str = "native",
        language: str = "Python",
        strict: bool = False,
    ) -> None:
        self.name = check_node_name(name)
        key = secrets.token_hex(16)
        self.id: str = node_id_from(key)
        """What the graph knows it by: 16 hexadecimal digits, new with each start of the program."""
        self._key = key
        self._numbers = itertools.count(1)
        self._backend = backend_named(text("transport", transport))
        self._master = self._backend.master(master)
        self._wait_s = seconds("wait_s", wait_s)
        self._is_strict = flag("strict", strict)
        self._lock = threading.RLock()
        self._publishers: set[Publisher] = set()
        self._subscribers: set[Subscriber] = set()
        self._is_closed = False
        self._is_forked = False
        self._log_handler: LogHandler | None = None
        self._parameters: Parameters | None = None
        record = NodeRecord(
            self.id,
            name,
            platform.node(),
            os.getpid(),
            language=language,
            generation=generation,
            since_ns=time.time_ns(),
            key=key,
            computer=computer_id(),
        )
        self._transport: Transport = self._backend.open(record)
        self._services = OwnedServices(
            self._transport, self._backend, self._wait_s, self._new_id, self._wake, self._closed_error
        )
        self._work = Work(name, self._transport, time.monotonic, self._services)
        _alive.add(self)
        _close_with_worker()
        forks.watch(self)

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
        return Hybrid(self._master if is_own else self._backend.master(master_ip), checked_mode(mode))

    def broker(self, mode: str = "many2many") -> Hybrid:
        """Return `hybrid(mode=mode)`: the original module's name for it up to 0.5.2."""
        return self.hybrid(mode=mode)

    def direct(
        self,
        ip: str = "127.0.0.1",
        port: str | int = "9000",
        mode: str = "one2many",
        transport: str = "",  # noqa: ARG002 - the node's transport is used, as in the original
        *,
        generation: Literal["A", "B"] = "A",
        wire: Literal["original", "native", "tcp"] = "original",
    ) -> Direct:
        """Connected without a master to `ip:port`; see `Direct` for the modes.

        Sends the frames of the original NEP up to 0.5.4.5, or from 0.5.4.8 on (`generation="B"`), or native
        ones; receives both forms of the original. `wire="tcp"` carries calls of services, also of programs
        that have no ZeroMQ. Raises `NepError` for what is no address, mode or port, `ValueError` for another
        generation or wire.
        """
        return Direct(
            checked_host(ip),
            checked_port(port),
            checked_mode(mode),
            one_of("generation", generation, ("A", "B")),
            one_of("wire", wire, ("original", "native", "tcp")),
        )

    # ---- publishers and subscribers

    def new_pub(
        self,
        topic: str,
        msg_type: MsgType = "json",
        configuration: Configuration | None = None,
        *,
        latched: bool = False,
        history: int = 0,
        batch: bool = True,
        qos: str = "",
        image: ImageFormat | None = None,
    ) -> Publisher:
        """A publisher. The first message reaches every subscriber that was there before this returned.

        `msg_type`: a name, or a dataclass or TypedDict, whose instances are published (docs/types.md).
        `latched`: whoever subscribes later gets the last message at once. `history`: it gets so many of the
        last ones, up to 1000 and 64 MB, in order and before those that follow. `batch`: messages published
        within 20 microseconds of each other may go out together, 100 microseconds later at most (the last
        ones of a burst that goes on for longer: 500). `qos`: a quality of service in one word, where the
        back end knows such ("ros2": "reliable", "best_effort", "sensor"). `image`: how pictures are sent,
        JPEG, PNG or raw, and how large. Raises `MasterUnreachable`, `BadTopicError`, `AddressInUseError`,
        `TooManyFilesError`, `ClosedError`, and `ValueError` for what is none of the allowed arguments.
        """
        connected = for_messages(self._configured(configuration))
        kept = max(history_for(self._backend, history, connected), 1 if latched is True else 0)
        number = next(self._numbers)
        spec = PublisherSpec(
            id_from(self._key, number),
            _own_topic(topic),
            name_of(msg_type),
            codec_with(codec_of(self._backend, msg_type), image),
            flag("latched", latched) or kept > 0,
            connected,
            self._wait_s,
            number,
            flag("batch", batch),
            quality_for(self._backend, qos),
            kept,
        )
        transport = self._open_transport().publisher(spec)
        publisher = Publisher(transport, spec, self._publishers.discard, is_strict=self._is_strict)
        with self._lock:
            self._publishers.add(publisher)
            is_late = self._is_closed
        if is_late:
            publisher.close(0.0)
            raise self._closed_error()
        return publisher

    def new_sub(
        self,
        topic: str,
        msg_type: MsgType = "json",
        configuration: Configuration | None = None,
        *,
        keep: Keep = "all",
        max_messages: int = MAX_MESSAGES,
        sink: Sink | None = None,
        qos: str = "",
        wildcards: bool = True,
    ) -> Subscriber:
        """A subscriber. What is published after this returned arrives, from every registered publisher.

        With a dataclass or TypedDict as `msg_type` its payloads are instances of that.
        A level of `topic` that is `*` is any level, `**` any number of them: "/robot/*/camera". Publishers
        of all topics that match are heard, also those that come later, and a message has its own topic;
        without `wildcards`, and in direct connections, the topic of just this name.
        `keep="latest"`: only the newest message is kept for `listen`; "all": up to `max_messages` (and
        256 MB), then the oldest are dropped and counted. `sink`: takes the messages in batches, 200 times a
        second at most, in a thread of the node's own, instead of `listen`. `qos` as for `new_pub`. Raises as
        `new_pub` does.
        """
        number = next(self._numbers)
        spec = SubscriberSpec(
            id_from(self._key, number),
            _own_topic(topic),
            name_of(msg_type),
            for_messages(self._configured(configuration)),
            self._wait_s,
            one_of("keep", keep, ("all", "latest")),
            at_least("max_messages", max_messages, 1),
            sink=sink_of(msg_type, sink),
            number=number,
            qos=quality_for(self._backend, qos),
            is_pattern=flag("wildcards", wildcards) and is_pattern_for(self._backend, topic, configuration),
        )
        return self._subscribed(self._open_transport().subscriber(spec), spec, msg_type)

    def new_callback(
        self,
        topic: str,
        msg_type: MsgType,
        callback: Callable[[Any], object],
        configuration: Configuration | None = None,
        *,
        keep: Keep = "all",
        max_messages: int = MAX_MESSAGES,
        with_message: bool = False,
        qos: str = "",
    ) -> Subscriber:
        """A subscriber whose payloads are given to `callback`, in the thread that calls `spin`.

        `keep` and `max_messages` as for `new_sub`: with `keep="latest"` a callback that is slower than the
        topic gets the newest message each time and never falls behind. `with_message`: it is given the
        `Message`, which has the payload, topic, stamp_ns, seq and publisher. A message that cannot be decoded
        is skipped, logged, and an alert in the graph, either way. `msg_type` and wildcards in `topic` as for
        `new_sub`, `qos` as for `new_pub`. Raises as `new_pub` does.
        """
        transport = self._open_transport()
        function("callback", callback)
        flag("with_message", with_message)
        number = next(self._numbers)
        spec = SubscriberSpec(
            id_from(self._key, number),
            _own_topic(topic),
            name_of(msg_type),
            for_messages(self._configured(configuration)),
            self._wait_s,
            one_of("keep", keep, ("all", "latest")),
            at_least("max_messages", max_messages, 1),
            number=number,
            qos=quality_for(self._backend, qos),
            is_pattern=is_pattern_for(self._backend, topic, configuration),
        )
        incoming = transport.subscriber(spec)
        subscriber = self._subscribed(incoming, spec, msg_type)
        self._work.add_callback(Callback(subscriber, incoming, callback, with_message))
        return subscriber

    def _new_id(self) -> tuple[int, int]:
        number = next(self._numbers)
        return id_from(self._key, number), number

    def _wake(self) -> None:
        """Who spins looks again at what there is to do."""
        self._work.wake()

    @property
    def is_closed(self) -> bool:
        """Whether it was closed, or is the parent's in a child that was forked."""
        return self._is_closed

    # ---- parameters

    @property
    def parameters(self) -> Parameters:
        """Its parameters: values that others may read and set while it runs (`nep param`)."""
        with self._lock:
            self._parameters = self._parameters or Parameters(self)
            return self._parameters

    def parameters_of(self, node: str, timeout_s: float | None = 5.0) -> RemoteParameters:
        """The parameters of another node, by its name or id. `timeout_s` is how long it may take to answer.

        Raises `NepError` when there is no such node, or several, or when it has declared none.
        """
        found = node_with_parameters(self.graph(), node)
        return RemoteParameters(self.new_client(place_of(found), timeout_s=timeout_s))

    def open_parameters(self, place: str, answer: Callable[[object], object]) -> Publisher:
        """See `nep.patterns.parameters.owned.ParameterHost`."""
        publisher = self.new_pub(place, MSG_TYPE, latched=True)
        if hasattr(self._open_transport(), "server"):
            try:
                self.new_server(place, answer, threads=1)
            except BaseException:
                publisher.close(0.0)
                raise
        return publisher

    def _configured(self, configuration: object) -> Configuration:
        if configuration is None:
            return self.hybrid()
        if not isinstance(configuration, Hybrid | Direct):
            kind = type(configuration).__name__
            raise WrongTypeError(
                _("configuration is a '{kind}'; make one with 'node.hybrid' or 'node.direct'").format(
                    kind=kind
                )
            )
        return configuration

    def _subscribed(
        self, transport: SubscriberTransport, spec: SubscriberSpec, msg_type: MsgType
    ) -> Subscriber:
        subscriber = new_subscriber(transport, spec, self._forget, msg_type)
        with self._lock:
            self._subscribers.add(subscriber)
            is_late = self._is_closed
        if is_late:
            subscriber.close()
            raise self._closed_error()
        return subscriber

    def _forget(self, subscriber: Subscriber) -> None:
        """It is closed."""
        with self._lock:
            self._subscribers.discard(subscriber)
        self._work.forget_callback(subscriber)

    # ---- spinning

    def new_timer(self, period_s: float, callback: Callable[[], object]) -> Timer:
        """A timer: `callback` is called every `period_s` seconds, in the thread that calls `spin`.

        So never beside another callback. The first call comes after one period. When it is late, because
        a callback took long or nobody span, it is called once, not once for each period that passed, and
        goes on at whole periods. What it raises comes out of `spin`. `Timer.cancel` ends it, and so does
        closing the node. Raises `ClosedError`, and `ValueError` for a period that is not above 0 or infinite.
        """
        self._open_transport()
        return self._work.new_timer(period("period_s", period_s), function("callback", callback))

    def spin(self, timeout_s: float | None = None) -> None:
        """Run callbacks and timers in this thread until `stop_spin`, `close`, or for `timeout_s` seconds.

        What they raise comes out here. A `stop_spin` that came before ends the next spin at once. In a
        child that is forked, also by a callback, it raises `ClosedError`. `nep.spin` does it for several
        nodes.
        """
        self._work.spin(seconds("timeout_s", timeout_s))

    async def spin_async(self, timeout_s: float | None = None) -> None:
        """As `spin`, in a loop of asyncio, whose other coroutines run while this one waits.

        Callbacks, and those of timers, may be coroutine functions. One at a time is called, and awaited: no
        callback of the node runs beside another one. Whatever is to go on meanwhile is a task of its own.
        """
        await spin_in_loop(self._work, seconds("timeout_s", timeout_s))

    def stop_spin(self) -> None:
        """End `spin` or `spin_async`, from any thread or from a callback."""
        if not self._is_forked:
            self._work.stop()

    # ---- what it tells, the graph, and the end

    @property
    def log(self) -> logging.Logger:
        """A logger whose records, from INFO on, Console and `nep log` show."""
        return self.log_handler.logger

    @property
    def log_handler(self) -> LogHandler:
        """Publishes records as this node's; add it to a logger to publish all that a program logs."""
        with self._lock:
            self._log_handler = self._log_handler or handler_of(self)
            return self._log_handler

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Who is there now. Raises `MasterUnreachable` when the master does not answer in time."""
        seconds("timeout_s", timeout_s)
        return self._open_transport().graph(self.hybrid(), timeout_s)

    def close(self, timeout_s: float = FLUSH_S) -> None:
        """Unregister and end; what was published is delivered first, within `timeout_s`. May be called twice.

        What could not be delivered is logged as a warning. Happens by itself when the interpreter ends.
        `new_pub`, `new_sub` and the like raise `ClosedError` when it comes while another thread is in them.
        """
        limit("timeout_s", timeout_s)
        _close((self,), timeout_s)

    def _end_log(self, timeout_s: float) -> None:
        """Publish what was logged, and no more."""
        if self._log_handler is not None:
            self._log_handler.close(timeout_s)

    def _begin_close(self) -> bool:
        """Say that all ends here, and wait for nothing; whether it was open. `_finish_close` follows."""
        with self._lock:
            if self._is_closed:
                return False
            self._is_closed = True
            publishers = tuple(self._publishers)
        _alive.discard(self)
        self._work.close()
        for publisher in publishers:
            publisher.node_closes()
        self._transport.begin_close()
        with self._lock:
            self._publishers.clear()
            self._subscribers.clear()
        return True

    def _finish_close(self, timeout_s: float) -> None:
        """Deliver what was published, within `timeout_s`, and give everything back."""
        deadline = time.monotonic() + timeout_s
        self._services.finish_calls(timeout_s / 2)
        self._transport.close(max(0.0, deadline - time.monotonic()))
        self._services.end(max(0.0, deadline - time.monotonic()))

    def forked(self) -> None:
        """In a child that was forked. See `nep.system.forks`."""
        self._is_closed = self._is_forked = True
        self._lock = threading.RLock()
        self._work.forked()
        for publisher in self._publishers:
            publisher.forked()
        for subscriber in self._subscribers:
            subscriber.forked()
        self._services.forked()
        if self._parameters is not None:
            self._parameters.forked()
        _alive.discard(self)
        _inherited.append(self)

    def _open_transport(self) -> Transport:
        if self._is_closed:
            raise self._closed_error()
        return self._transport

    def _closed_error(self) -> ClosedError:
        return ClosedError(f"node '{self.name}'", is_forked=self._is_forked)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Node({self.name!r}, {self._backend.name!r}, master={self._master!r})"


def _own_topic(topic: str) -> str:
    """`topic` itself when messages may travel on it. Raises `BadTopicError`."""
    if check_topic(topic).startswith(PREFIX):
        raise BadTopicError(topic, _("names that begin with '{prefix}' are services'").format(prefix=PREFIX))
    return topic


def spin(*nodes: Node, timeout_s: float | None = None) -> None:
    """Run callbacks and timers of all these nodes in this thread, as `Node.spin` does for one.

    They may be of different back ends. They take turns: in each round every timer that is due is called, and
    every callback that has a message is given one. `stop_spin` of a node ends its part; the others go on.
    Ends when all nodes are stopped or closed, or after `timeout_s` seconds. Raises `ValueError` for what are
    no nodes, or none.
    """
    if not nodes or not all(isinstance(each, Node) for each in nodes):
        raise WrongTypeError(_("spin was given something else than nodes; give it one node or more"))
    works = dict.fromkeys(each._work for each in nodes)  # noqa: SLF001 - they are one with the node
    spin_all(tuple(works), seconds("timeout_s", timeout_s))


def _close(nodes: Sequence[Node], timeout_s: float) -> None:
    """Close all of them within `timeout_s`: no node's subscribers wait for those of another node."""
    started = time.monotonic()
    for each in nodes:
        each._end_log(0.0)  # noqa: SLF001 - they are one with the node
    for each in nodes:  # what they publish goes out like anything else
        each._end_log(max(0.0, started + timeout_s / 4 - time.monotonic()))  # noqa: SLF001
    for each in [each for each in nodes if each._begin_close()]:  # noqa: SLF001
        each._finish_close(max(0.0, started + timeout_s - time.monotonic()))  # noqa: SLF001


def _close_all() -> None:
    _close(tuple(_alive), FLUSH_S)


def _close_with_worker() -> None:
    """Let a worker of `multiprocessing` close its nodes: one that was forked skips the interpreter's exit.

    It forgets what was registered before it began, so this is done when a node is made.
    """
    global _closed_in  # noqa: PLW0603 - one for the process
    parent_of_worker = getattr(sys.modules.get("multiprocessing.process"), "parent_process", None)
    if _closed_in != os.getpid() and parent_of_worker is not None and parent_of_worker() is not None:
        _closed_in = os.getpid()
        sys.modules["multiprocessing.util"].Finalize(None, _close_all, exitpriority=_WORKER_PRIORITY)


atexit.register(_close_all)
