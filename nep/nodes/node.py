"""Node: a program's participant in a network, with its publishers, subscribers and services."""

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

# its exit handler must be registered before ours: it frees frames that are still being sent
import zmq.utils.garbage  # noqa: F401

import nep.system.exits  # noqa: F401 - its exit hook must be older than ours, too
from nep.backends.base import (
    PublisherSpec,
    Sink,
    SubscriberSpec,
    SubscriberTransport,
    Transport,
    find_backend,
)
from nep.backends.connection import (
    Configuration,
    Direct,
    Hybrid,
    parse_port,
    require_topic_support,
    validate_mode,
)
from nep.errors import BadTopicError, ClosedError, WrongTypeError
from nep.i18n import _
from nep.messages.image_codec import ImageFormat
from nep.messages.queue import MAX_MESSAGES, QueuePolicy
from nep.nodes.arguments import (
    check_at_least,
    check_bool,
    check_choice,
    check_function,
    check_optional_time_limit,
    check_period,
    check_time_limit,
    check_type_name,
)
from nep.nodes.async_spinning import spin as spin_in_loop
from nep.nodes.backend_checks import check_history, check_quality, codec_with_image_format, is_pattern_for
from nep.nodes.executor import spin_all
from nep.nodes.log_handler import LogHandler, new_log_handler
from nep.nodes.publisher import Publisher
from nep.nodes.subscriber import Subscriber
from nep.nodes.timer import Timer
from nep.nodes.typed import MsgType, codec_of, name_of, new_subscriber, wrap_sink
from nep.nodes.work import Callback, Work
from nep.patterns.parameters.node_parameters import MSG_TYPE, Parameters, parameters_topic
from nep.patterns.parameters.remote import RemoteParameters, node_with_parameters
from nep.patterns.services.registry import ServiceRegistry
from nep.patterns.services.service_node import ServiceNode
from nep.protocol.graph_view import GraphView
from nep.protocol.requests import NodeRecord, derive_id, derive_node_id
from nep.protocol.service_wire import SERVICE_PREFIX
from nep.protocol.wire import check_node_name, check_topic
from nep.system import forks
from nep.system.addresses import check_host
from nep.system.computer import computer_id

if TYPE_CHECKING:
    from typing_extensions import Self


FLUSH_TIMEOUT_S = 2.0
"""Time in seconds that closing waits for published messages to be delivered."""

_FINALIZER_PRIORITY = 10
"""Exit priority for `multiprocessing`.

Not negative, so that nodes are closed before a worker joins its own children, which may need published
messages.
"""

_open_nodes: set[Node] = set()
"""Open nodes, referenced until they are closed, because a publisher may outlive the variable of its node."""
_finalizer_pid = 0
"""Id of the process in which `multiprocessing` is set up to close the nodes at exit."""


class Node(ServiceNode):
    """Participant in a network, with publishers, subscribers, services, timers and parameters.

    A node connects to the master when its first publisher, subscriber or service is created. Thread-safe;
    usable as a context manager. In a forked child process it is closed, with everything created on it; open a
    new one there.

        with nep.node("camera") as node:
            pub = node.new_pub("/camera/state")
            pub.publish({"on": True})

    Args:
        name: Name shown to others. Several nodes may share a name; the graph reports an alert then.
        transport: Back end: "zeromq" (alias "ZMQ"), "memory" (nodes of this process only), "zenoh",
            "nanomsg", "ros" or "ros2" (docs/backends.md).
        master: Address of the master. Default: $NEP_MASTER, else 127.0.0.1:7780.
        wait_s: Time in seconds to wait for a master when a publisher, subscriber, server, client or surveyor
            is created; None waits without limit.
        generation: Kind of node reported in the graph; gateways to other systems use other values.
        language: Programming language reported in the graph; "web" for the web pages of `nep web`.
        strict: Make every publisher raise `EncodeError` for payloads that can't be encoded
            (`Publisher.publish`).

    Raises:
        UnknownBackendError: There is no back end of this name.
        BackendUnavailableError: The back end is not installed.
        BadNameError: The name is invalid.
        TooManyFilesError: The process has too many open files.
        ValueError: `wait_s` or `strict` is invalid.
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
        self.id: str = derive_node_id(key)
        """Id in the graph: 16 hexadecimal digits, new at each start of the program."""
        self._key = key
        self._numbers = itertools.count(1)
        self._backend = find_backend(check_type_name("transport", transport))
        self._master = self._backend.master(master)
        self._wait_s = check_optional_time_limit("wait_s", wait_s)
        self._is_strict = check_bool("strict", strict)
        self._lock = threading.RLock()
        self._publishers: set[Publisher] = set()
        self._subscribers: set[Subscriber] = set()
        self._is_closed = False
        self._generation = forks.current_generation()
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
        self._services = ServiceRegistry(
            self._transport, self._backend, self._wait_s, self._new_id, self._wake, self._closed_error
        )
        self._work = Work(name, self._transport, time.monotonic, self._services)
        _open_nodes.add(self)
        _register_worker_close()

    # ---- configurations

    def hybrid(
        self,
        master_ip: str = "127.0.0.1",
        mode: str = "many2many",
        transport: str = "",  # noqa: ARG002 - as in the original, the node's own transport is used
    ) -> Hybrid:
        """Return the configuration for a connection through a master.

        Args:
            master_ip: Address of the master; "127.0.0.1" means the node's own master.
            mode: Accepted for compatibility; any number of publishers and subscribers can connect.
            transport: Ignored; the node's transport is used.
        """
        is_own = master_ip == "127.0.0.1" or self._backend.name == "memory"
        return Hybrid(self._master if is_own else self._backend.master(master_ip), validate_mode(mode))

    def broker(self, mode: str = "many2many") -> Hybrid:
        """Return `hybrid(mode=mode)`. The original module used this name up to version 0.5.2."""
        return self.hybrid(mode=mode)

    def direct(
        self,
        ip: str = "127.0.0.1",
        port: str | int = "9000",
        mode: str = "one2many",
        transport: str = "",  # noqa: ARG002 - as in the original, the node's own transport is used
        *,
        generation: Literal["A", "B"] = "A",
        wire: Literal["original", "native", "tcp"] = "original",
    ) -> Direct:
        """Return the configuration for a connection to a fixed address, without a master.

            sub = node.new_sub("scan", "json", node.direct("192.168.0.7", 9000))

        Args:
            ip: Address to bind or connect to.
            port: Port, 1 to 65535.
            mode: End that binds the port. See `Direct`.
            transport: Ignored; the node's transport is used.
            generation: Format of sent frames: "A" for the original NEP up to 0.5.4.5, "B" for 0.5.4.8
                and later. Both formats are received.
            wire: "original" or "native" frames; "tcp" for service calls over plain TCP, also from
                programs without ZeroMQ.

        Raises:
            NepError: Invalid address, mode or port.
            ValueError: Invalid generation or wire.
        """
        return Direct(
            check_host(ip),
            parse_port(port),
            validate_mode(mode),
            check_choice("generation", generation, ("A", "B")),
            check_choice("wire", wire, ("original", "native", "tcp")),
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
        """Create a publisher.

        The first message reaches every subscriber that was registered before this call returned.

            pub = node.new_pub("/robot/pose", "json", latched=True)
            pub.publish({"x": 1.5, "y": 0.0})

        Args:
            topic: Name of the topic.
            msg_type: "json", "string", "bytes", "msgpack", "image" or another registered name; or a dataclass
                or TypedDict, whose instances are published (docs/types.md).
            configuration: Result of `hybrid` or `direct`. Default: the node's master.
            latched: Send the newest message to later subscribers.
            history: Number of messages sent to later subscribers, in order: 0 to 1000, 64 MB at most.
            batch: Combine messages published within 20 µs of each other; adds up to 100 µs of latency (500 µs
                for the last messages of a longer burst).
            qos: Quality of service of the back end; "ros2" has "reliable", "best_effort" and "sensor".
            image: Encoding and size of images: JPEG, PNG or raw.

        Raises:
            MasterUnreachable: No master replied within `wait_s`.
            BadTopicError: The topic name is invalid.
            AddressInUseError: The address of a direct connection is in use.
            TooManyFilesError: The process has too many open files.
            ClosedError: The node is closed.
            ValueError: An argument is invalid.
        """
        topic_configuration = require_topic_support(self._resolve_configuration(configuration))
        history_length = max(
            check_history(self._backend, history, topic_configuration), 1 if latched is True else 0
        )
        number = next(self._numbers)
        spec = PublisherSpec(
            derive_id(self._key, number),
            _check_user_topic(topic),
            name_of(msg_type),
            codec_with_image_format(codec_of(self._backend, msg_type), image),
            check_bool("latched", latched) or history_length > 0,
            topic_configuration,
            self._wait_s,
            number,
            check_bool("batch", batch),
            check_quality(self._backend, qos),
            history_length,
        )
        transport = self._open_transport().create_publisher(spec)
        publisher = Publisher(transport, spec, self._publishers.discard, is_strict=self._is_strict)
        with self._lock:
            self._publishers.add(publisher)
            is_node_closed = self._is_closed
        if is_node_closed:
            publisher.close(0.0)
            raise self._closed_error()
        return publisher

    def new_sub(
        self,
        topic: str,
        msg_type: MsgType = "json",
        configuration: Configuration | None = None,
        *,
        keep: QueuePolicy = "all",
        max_messages: int = MAX_MESSAGES,
        sink: Sink | None = None,
        qos: str = "",
        wildcards: bool = True,
    ) -> Subscriber:
        """Create a subscriber.

        The subscriber receives every message that any registered publisher publishes after this call
        returned.

            with node.new_sub("/robot/*/camera", "image", keep="latest") as sub:
                for message in sub:
                    show(message.payload)

        Args:
            topic: Name of the topic, or a pattern: `*` matches one level, `**` any number of levels. A
                pattern also matches topics that are created later. `Message.topic` is the name of the
                message's topic.
            msg_type: As for `new_pub`; with a dataclass or TypedDict the payloads are instances of the
                class.
            configuration: Result of `hybrid` or `direct`. Default: the node's master.
            keep: "all": queue up to `max_messages` (256 MB at most), then drop the oldest; "latest":
                queue only the newest.
            max_messages: Length of the queue, 1 or more.
            sink: Function called with lists of messages, at most 200 times per second, in a thread of
                the node; replaces `listen`.
            qos: As for `new_pub`.
            wildcards: False to treat `*` as part of the name, as direct connections do.

        Raises:
            NepError: As `new_pub` does.
            ValueError: An argument is invalid, or the back end has no patterns.
        """
        number = next(self._numbers)
        spec = SubscriberSpec(
            derive_id(self._key, number),
            _check_user_topic(topic),
            name_of(msg_type),
            require_topic_support(self._resolve_configuration(configuration)),
            self._wait_s,
            check_choice("keep", keep, ("all", "latest")),
            check_at_least("max_messages", max_messages, 1),
            sink=wrap_sink(msg_type, sink),
            number=number,
            qos=check_quality(self._backend, qos),
            is_pattern=check_bool("wildcards", wildcards)
            and is_pattern_for(self._backend, topic, configuration),
        )
        return self._add_subscriber(self._open_transport().create_subscriber(spec), spec, msg_type)

    def new_callback(
        self,
        topic: str,
        msg_type: MsgType,
        callback: Callable[[Any], object],
        configuration: Configuration | None = None,
        *,
        keep: QueuePolicy = "all",
        max_messages: int = MAX_MESSAGES,
        with_message: bool = False,
        qos: str = "",
    ) -> Subscriber:
        """Create a subscriber whose payloads are passed to `callback` in the thread that calls `spin`.

            node.new_callback("/robot/pose", "json", lambda pose: print(pose["x"]))
            node.spin()

        Messages that can't be decoded are skipped, logged, and reported as an alert in the graph.

        Args:
            topic: Name or pattern, as for `new_sub`.
            msg_type: As for `new_sub`.
            callback: Function of one argument; a coroutine function needs `spin_async`.
            configuration: Result of `hybrid` or `direct`. Default: the node's master.
            keep: "all" or "latest", as for `new_sub`. With "latest" a slow callback always gets the newest
                message.
            max_messages: Length of the queue, 1 or more.
            with_message: Pass the `Message` (payload, topic, stamp_ns, seq, publisher) instead of the
                payload.
            qos: As for `new_pub`.

        Raises:
            NepError: As `new_pub` does.
            ValueError: An argument is invalid.
        """
        transport = self._open_transport()
        check_function("callback", callback)
        check_bool("with_message", with_message)
        number = next(self._numbers)
        spec = SubscriberSpec(
            derive_id(self._key, number),
            _check_user_topic(topic),
            name_of(msg_type),
            require_topic_support(self._resolve_configuration(configuration)),
            self._wait_s,
            check_choice("keep", keep, ("all", "latest")),
            check_at_least("max_messages", max_messages, 1),
            number=number,
            qos=check_quality(self._backend, qos),
            is_pattern=is_pattern_for(self._backend, topic, configuration),
        )
        subscriber_transport = transport.create_subscriber(spec)
        subscriber = self._add_subscriber(subscriber_transport, spec, msg_type)
        self._work.add_callback(Callback(subscriber, subscriber_transport, callback, with_message))
        return subscriber

    def _new_id(self) -> tuple[int, int]:
        number = next(self._numbers)
        return derive_id(self._key, number), number

    def _wake(self) -> None:
        self._work.wake()

    @property
    def is_closed(self) -> bool:
        """True if the node was closed, or if this is a forked child process."""
        return self._is_closed or self._generation.is_inherited

    # ---- parameters

    @property
    def parameters(self) -> Parameters:
        """Parameters of this node: named values that others can read and set at run time (`nep param`)."""
        with self._lock:
            self._parameters = self._parameters or Parameters(self)
            return self._parameters

    def parameters_of(self, node: str, timeout_s: float | None = 5.0) -> RemoteParameters:
        """Return the parameters of another node.

        Args:
            node: Name or id of the node.
            timeout_s: Time limit of each request in seconds; None for no limit.

        Raises:
            NepError: No node or several nodes match, or the node has no parameters.
        """
        node_id = node_with_parameters(self.graph(), node)
        return RemoteParameters(self.new_client(parameters_topic(node_id), timeout_s=timeout_s))

    def open_parameters(self, name: str, callback: Callable[[object], object]) -> Publisher:
        """Open the latched topic `name` for this node's parameters, and the service `name` if supported.

        Internal; used by `Parameters`.

        Args:
            name: Name of the topic and the service.
            callback: Callback of the service.
        """
        publisher = self.new_pub(name, MSG_TYPE, latched=True)
        if hasattr(self._open_transport(), "create_server"):
            try:
                self.new_server(name, callback, threads=1)
            except BaseException:
                publisher.close(0.0)
                raise
        return publisher

    def _resolve_configuration(self, configuration: object) -> Configuration:
        if configuration is None:
            return self.hybrid()
        if not isinstance(configuration, Hybrid | Direct):
            kind = type(configuration).__name__
            raise WrongTypeError(
                _("'configuration' is a '{kind}'; create it with 'node.hybrid' or 'node.direct'").format(
                    kind=kind
                )
            )
        return configuration

    def _add_subscriber(
        self, transport: SubscriberTransport, spec: SubscriberSpec, msg_type: MsgType
    ) -> Subscriber:
        subscriber = new_subscriber(transport, spec, self._remove_subscriber, msg_type)
        with self._lock:
            self._subscribers.add(subscriber)
            is_node_closed = self._is_closed
        if is_node_closed:
            subscriber.close()
            raise self._closed_error()
        return subscriber

    def _remove_subscriber(self, subscriber: Subscriber) -> None:
        with self._lock:
            self._subscribers.discard(subscriber)
        self._work.remove_callback(subscriber)

    # ---- spinning

    def new_timer(self, period_s: float, callback: Callable[[], object]) -> Timer:
        """Create a timer that calls `callback` every `period_s` seconds in the thread that calls `spin`.

        The first call is after one period. Missed ticks are coalesced: a late timer is called once, and the
        schedule stays aligned to the period. Callbacks never run concurrently. Exceptions propagate out of
        `spin`. Cancel it with `Timer.cancel`; closing the node cancels it, too.

        Args:
            period_s: Period in seconds, above 0 and finite.
            callback: Function without arguments; a coroutine function needs `spin_async`.

        Raises:
            ClosedError: The node is closed.
            ValueError: The period is invalid.
        """
        self._open_transport()
        return self._work.new_timer(check_period("period_s", period_s), check_function("callback", callback))

    def spin(self, timeout_s: float | None = None) -> None:
        """Run callbacks, timers and servers in this thread until `stop_spin` or `close` is called.

        Exceptions of callbacks propagate. If `stop_spin` was called before, returns immediately. Use
        `nep.spin` for several nodes.

        Args:
            timeout_s: Time limit in seconds; None for no limit.

        Raises:
            ClosedError: This is a forked child process, also if a callback forked it.
        """
        self._work.spin(check_optional_time_limit("timeout_s", timeout_s))

    async def spin_async(self, timeout_s: float | None = None) -> None:
        """Run callbacks, timers and servers in the running asyncio event loop; otherwise as `spin`.

        Callbacks may be coroutine functions. They are awaited one at a time, so that callbacks of a node
        never run concurrently; start a task for work that should continue in the background.

        Args:
            timeout_s: Time limit in seconds; None for no limit.
        """
        await spin_in_loop(self._work, check_optional_time_limit("timeout_s", timeout_s))

    def stop_spin(self) -> None:
        """Stop the running `spin` or `spin_async`; if none is running, the next one returns immediately.

        Thread-safe; may also be called in callbacks.
        """
        if not self._generation.is_inherited:
            self._work.stop()

    # ---- logging, graph, closing

    @property
    def log(self) -> logging.Logger:
        """Logger of this node. Records from INFO on are published to Studio's Console and `nep log`."""
        return self.log_handler.logger

    @property
    def log_handler(self) -> LogHandler:
        """Logging handler that publishes records as this node.

        Add it to a logger to publish everything that is logged there.
        """
        with self._lock:
            self._log_handler = self._log_handler or new_log_handler(self)
            return self._log_handler

    def graph(self, timeout_s: float = 2.0) -> GraphView:
        """Return a snapshot of all nodes, topics, services and alerts that the master knows.

        Args:
            timeout_s: Time limit in seconds.

        Raises:
            MasterUnreachable: The master did not reply in time.
        """
        check_optional_time_limit("timeout_s", timeout_s)
        return self._open_transport().graph(self.hybrid(), timeout_s)

    def close(self, timeout_s: float = FLUSH_TIMEOUT_S) -> None:
        """Unregister the node and close everything created on it. Idempotent.

        Published messages are delivered first; messages that can't be delivered in time are logged as a
        warning. Called automatically at interpreter exit. A concurrent `new_pub`, `new_sub` or similar
        call raises `ClosedError`.

        Args:
            timeout_s: Time limit for the delivery in seconds.
        """
        check_time_limit("timeout_s", timeout_s)
        if not self._generation.is_inherited:
            _close((self,), timeout_s)

    def _close_log(self, timeout_s: float) -> None:
        if self._log_handler is not None:
            self._log_handler.close(timeout_s)

    def _begin_close(self) -> bool:
        # Starts closing without waiting; returns False if already closed. `_finish_close` must follow.
        with self._lock:
            if self._is_closed:
                return False
            self._is_closed = True
            publishers = tuple(self._publishers)
        _open_nodes.discard(self)
        self._work.close()
        for publisher in publishers:
            publisher.on_node_close()
        self._transport.begin_close()
        with self._lock:
            self._publishers.clear()
            self._subscribers.clear()
        return True

    def _finish_close(self, timeout_s: float) -> None:
        deadline = time.monotonic() + timeout_s
        self._services.finish_calls(timeout_s / 2)
        self._transport.close(max(0.0, deadline - time.monotonic()))
        self._services.stop_threads(max(0.0, deadline - time.monotonic()))

    def _open_transport(self) -> Transport:
        if self.is_closed:
            raise self._closed_error()
        return self._transport

    def _closed_error(self) -> ClosedError:
        return ClosedError(f"node '{self.name}'", is_forked=self._generation.is_inherited)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Node({self.name!r}, {self._backend.name!r}, master={self._master!r})"


def _check_user_topic(topic: str) -> str:
    # Service names start with a reserved prefix.
    if check_topic(topic).startswith(SERVICE_PREFIX):
        raise BadTopicError(
            topic,
            _("names that start with '{prefix}' are reserved for services").format(prefix=SERVICE_PREFIX),
        )
    return topic


def spin(*nodes: Node, timeout_s: float | None = None) -> None:
    """Run the callbacks, timers and servers of several nodes in this thread.

    The nodes may use different back ends. Scheduling is round-robin: in each round every due timer is
    called, and every callback with a message gets one. When `Node.stop_spin` is called on one node, the
    others continue.

        nep.spin(camera, arm, timeout_s=10.0)

    Args:
        nodes: One or more nodes.
        timeout_s: Time limit in seconds; None runs until all nodes are stopped or closed.

    Raises:
        ValueError: No nodes are given, or an argument is not a node.
        ClosedError: This is a forked child process.
    """
    if not nodes or not all(isinstance(each, Node) for each in nodes):
        raise WrongTypeError(_("'spin' requires at least one node"))
    works = dict.fromkeys(each._work for each in nodes)  # noqa: SLF001 - private to this module
    spin_all(tuple(works), check_optional_time_limit("timeout_s", timeout_s))


def _close(nodes: Sequence[Node], timeout_s: float) -> None:
    # Closes all nodes within `timeout_s`. All begin to close first, so that none waits for another.
    started = time.monotonic()
    for node in nodes:
        node._close_log(0.0)  # noqa: SLF001 - private to this module
    for node in nodes:  # the logs must be flushed before the publishers close
        node._close_log(max(0.0, started + timeout_s / 4 - time.monotonic()))  # noqa: SLF001
    for node in [node for node in nodes if node._begin_close()]:  # noqa: SLF001
        node._finish_close(max(0.0, started + timeout_s - time.monotonic()))  # noqa: SLF001


def _close_all() -> None:
    _close(tuple(_open_nodes), FLUSH_TIMEOUT_S)


def _give_up_in_child() -> None:
    for node in _open_nodes:  # its logger and its parameters can still be used
        node._lock = threading.RLock()  # noqa: SLF001 - private to this module
    forks.prevent_finalization(*_open_nodes)  # with their sockets
    _open_nodes.clear()


def _register_worker_close() -> None:
    # A forked worker of `multiprocessing` skips the interpreter's exit handlers, so closing is registered
    # with `multiprocessing` itself. It forgets registrations made before it starts: register when a node is
    # created.
    global _finalizer_pid  # noqa: PLW0603 - one per process
    parent_of_worker = getattr(sys.modules.get("multiprocessing.process"), "parent_process", None)
    if _finalizer_pid != os.getpid() and parent_of_worker is not None and parent_of_worker() is not None:
        _finalizer_pid = os.getpid()
        sys.modules["multiprocessing.util"].Finalize(None, _close_all, exitpriority=_FINALIZER_PRIORITY)


atexit.register(_close_all)
forks.call_in_child(_give_up_in_child)
