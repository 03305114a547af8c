"""The ROS node of this process, shared by all its nep nodes.

rospy allows one node per process and can't be restarted. The ROS node is therefore named after the
first nep node and lives until the process ends; a nep node that closes only unregisters its publishers
and subscribers.
"""

from __future__ import annotations

import atexit
import ipaddress
import logging
import os
import re
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from nep.backends.ros.address import is_loopback_address, ros_master_address
from nep.backends.ros.library import get_rospy
from nep.backends.ros.master import NodeRegistrations, RosMaster, RosMasterUnreachable, connections_of
from nep.backends.ros.queue_room import QueueLimit
from nep.backends.ros.service_connection import HandshakeLimiter
from nep.backends.ros_types.definition import Definition
from nep.errors import BadTopicError, ClosedError, NepError
from nep.i18n import _
from nep.system.exits import call_after_nodes
from nep.system.forks import call_in_child, close_in_child
from nep.text import escaped, shortened

_logger = logging.getLogger("nep")

_INVALID_CHARACTERS = re.compile(r"\W+", re.ASCII)
_TOPIC = re.compile(r"[~/A-Za-z][\w/]*", re.ASCII)
_POLL_S = 0.01
_REQUEST_TIMEOUT_S = 0.5
_MASTER_CHECK_INTERVAL_S = 1.0
"""Interval in seconds for detecting a restart of the master."""
_MIN_TIMEOUT_S = 0.2
"""Minimum timeout in seconds of a request to the master, even if the caller's timeout is shorter."""


def ros_topic(topic: str) -> str:
    """Validate a topic as a ROS name and return it. Raises `BadTopicError`."""
    if not _TOPIC.fullmatch(topic) or "//" in topic or topic.endswith(("/", "~")):
        raise BadTopicError(
            topic,
            _("a ROS topic must start with a letter or '/', and contain only letters, digits, '_' and '/'"),
        )
    return topic


class RosShutdownError(ClosedError):
    """Error of operations after rospy was shut down.

    rospy is shut down by the program itself, by 'rosnode kill', or by a new node with the same name.
    """

    def __init__(self) -> None:
        self.what = "rospy"
        self.is_forked = False
        NepError.__init__(
            self,
            _("rospy was shut down and can't start again in this process; restart the program"),
        )


class RosProcess:
    """ROS node of this process. Thread-safe."""

    def __init__(self, rospy: Any, address: str) -> None:  # noqa: ANN401 - rospy is not typed
        self.rospy = rospy
        self.master = RosMaster(address)
        self.name: str = rospy.get_name()
        self.uri: str = rospy.get_node_uri()
        self.changed = threading.Condition()
        """Notified when a subscriber connects to a publisher."""
        self._lock = threading.RLock()
        self._seq_lock = threading.Lock()
        self._types: dict[str, tuple[str, int]] = {}
        self._classes: dict[str, type] = {}
        self._seqs: Counter[str] = Counter()
        self.subscriber_counts: Counter[str] = Counter()
        """Number of nep subscribers in this process, by topic."""
        self._publishers_by_topic: dict[str, dict[int, Any]] = {}
        self.handshakes = HandshakeLimiter()
        self.shutdown_callbacks: set[Callable[[], None]] = set()
        """Functions called when rospy is shut down before the program ends."""
        self._ended = threading.Event()
        rospy.on_shutdown(self._on_rospy_shutdown)
        threading.Thread(target=self._monitor_master, name="nep-ros-master", daemon=True).start()

    @property
    def is_shut_down(self) -> bool:
        """True after rospy was shut down; messages are then no longer sent or received."""
        return bool(self.rospy.core.is_shutdown_requested())

    def shut_down(self) -> None:
        """Shut rospy down at the end of the program, which unregisters the node from the master.

        If the master doesn't reply, rospy isn't shut down, because unregistering would block.
        """
        self._ended.set()
        try:
            self.master.wait(_REQUEST_TIMEOUT_S)
        except RosMasterUnreachable:
            return
        self.rospy.signal_shutdown("the program exits")

    def _on_rospy_shutdown(self) -> None:
        if not self._ended.is_set():
            self._ended.set()
            _logger.warning("%s", RosShutdownError())
            for callback in list(self.shutdown_callbacks):
                callback()

    def _monitor_master(self) -> None:
        # Thread that detects restarts of the master; runs until rospy is shut down.
        while not self._ended.wait(_MASTER_CHECK_INTERVAL_S):
            if self.master.is_node_unknown(self.name, _REQUEST_TIMEOUT_S) and self._restore_registrations():
                _logger.warning("the ROS master at '%s' was restarted; registered again", self.master.address)

    def _restore_registrations(self) -> bool:
        # Repeats rospy's registrations, which rospy doesn't do after a restart of the master. Returns False
        # on failure.
        registration = self.rospy.impl.registration
        topics, services = registration.get_topic_manager(), registration.get_service_manager().get_services()
        with topics.lock:  # a registration removed meanwhile must not be restored
            registrations = NodeRegistrations(topics.get_publications(), topics.get_subscriptions(), services)
            return bool(
                registrations.publications or registrations.subscriptions or services
            ) and self.master.register(self.name, self.uri, registrations, _REQUEST_TIMEOUT_S)

    def resolve_name(self, topic: str) -> str:
        """Return the full name of a topic or service. Raises `BadTopicError`."""
        return str(self.rospy.resolve_name(ros_topic(topic)))

    # ---- publishers

    def advertise(self, topic: str, definition: Definition, *, is_latched: bool, queue_length: int) -> Any:  # noqa: ANN401 - rospy is not typed
        """Create a publisher of rospy and return it.

        Args:
            topic: Full name of the topic.
            definition: Message type.
            is_latched: True to latch the newest message.
            queue_length: Queue length per connection in messages.

        Raises:
            NepError: The process already publishes another type on the topic.
        """
        with self._lock:
            impl = self.rospy.impl.registration.get_topic_manager().get_publisher_impl(topic)
            # may be the program's own, such as that of /rosout
            default_type = definition.name if impl is None else impl.type
            topic_type, users = self._types.get(topic, (default_type, 0))
            if topic_type != definition.name:
                raise NepError(
                    _(
                        "this program publishes '{known}' on '{topic}', and ROS allows only one type per "
                        "topic in a program; publish '{name}' on another topic"
                    ).format(known=topic_type, topic=topic, name=definition.name)
                )
            publisher = self.rospy.Publisher(
                topic, self._message_class(definition), subscriber_listener=self, tcp_nodelay=True,
                latch=is_latched, queue_size=queue_length,
            )  # fmt: skip
            self._types[topic] = definition.name, users + 1
        return publisher

    def add_publisher(self, topic: str, id_: int, publisher: Any) -> None:  # noqa: ANN401 - rospy is not typed
        """Register a nep publisher that uses the rospy publisher returned by `advertise`."""
        with self._lock:
            self._publishers_by_topic.setdefault(topic, {})[id_] = publisher

    def remove_publisher(self, topic: str, id_: int) -> None:
        """Remove a closed publisher that `add_publisher` registered."""
        with self._lock:
            self._publishers_by_topic.get(topic, {}).pop(id_, None)

    def local_publisher_id(self, topic: str) -> int | None:
        """Return the id of this process's publisher on a topic; None if there isn't exactly one.

        ROS reports only the process that sent a message. The publisher is therefore unknown if nep nodes
        have several publishers on the topic, or if the program itself also publishes on it.
        """
        with self._lock:
            publishers = self._publishers_by_topic.get(topic, {})
            if len(publishers) != 1:
                return None
            ((id_, publisher),) = publishers.items()
            impl = publisher.impl
            return id_ if impl is not None and impl.ref_count == 1 else None

    def unadvertise(self, topic: str, publisher: Any, timeout_s: float) -> None:  # noqa: ANN401 - rospy is not typed
        """Unregister a publisher returned by `advertise`, within `timeout_s` seconds."""
        if self.is_shut_down or not run_with_timeout(publisher.unregister, timeout_s):
            return  # rospy still has the topic
        with self._lock:
            topic_type, users = self._types[topic]
            self._types[topic] = topic_type, users - 1
            if users == 1:
                del self._types[topic]

    def unsubscribe(self, subscriber: Any, timeout_s: float) -> None:  # noqa: ANN401 - rospy is not typed
        """Unregister a subscriber of rospy, within `timeout_s` seconds."""
        if not self.is_shut_down:
            run_with_timeout(subscriber.unregister, timeout_s)

    def wait_until_sent(self, publisher: Any, deadline: float) -> int:  # noqa: ANN401 - rospy is not typed
        """Wait until rospy has sent its queues; return the number of connections with unsent messages.

        Args:
            publisher: Publisher returned by `advertise`.
            deadline: Time (`time.monotonic`) at which to stop waiting.
        """
        impl = publisher.impl
        pause = threading.Event()
        while True:
            unsent_count = sum(_has_unsent_data(each) for each in ([] if impl is None else impl.connections))
            if not unsent_count or time.monotonic() >= deadline:
                return unsent_count
            pause.wait(_POLL_S)

    def send(self, publisher: Any, definition: Definition, topic: str, body: bytes, limit: QueueLimit) -> int:  # noqa: ANN401
        """Publish a message body; return the number of older messages dropped from full queues.

        The header gets the next sequence number of its topic, as rospy would assign it.

        Args:
            publisher: Publisher returned by `advertise`.
            definition: Message type.
            topic: Full name of the topic.
            body: Encoded message.
            limit: Limit in bytes for the publisher's queues.
        """
        message = self._message_class(definition)()
        impl = publisher.impl
        with self._seq_lock:
            dropped = limit.make_room([] if impl is None else impl.connections, len(body))
            if definition.has_header:
                self._seqs[topic] += 1
                body = (self._seqs[topic] & 0xFFFFFFFF).to_bytes(4, "little") + body[4:]
            message.body = body
            try:
                publisher.publish(message)
            except self.rospy.ROSException:  # already shut down
                raise RosShutdownError from None
        return dropped

    def _message_class(self, definition: Definition) -> type:
        # Creates a message class whose instances hold encoded bodies.
        message_class = self._classes.get(definition.name)
        if message_class is None:
            genpy = self.rospy.msg.genpy
            installed_class = genpy.message.get_message_class(definition.name)

            def serialize(message: Any, buffer: Any) -> None:  # noqa: ANN401 - rospy is not typed
                buffer.write(message.body)

            message_class = self._classes[definition.name] = type(
                "EncodedMessage",
                (genpy.Message,),
                {
                    "__slots__": ["body"], "_slot_types": ["uint8[]"], "_has_header": False,
                    "_type": definition.name, "_md5sum": installed_class._md5sum,  # noqa: SLF001
                    "_full_text": definition.text,
                    "serialize": serialize,
                },
            )  # fmt: skip
        return message_class

    # ---- services

    def create_server(self, service: str, service_class: type, handler: Callable[[Any], Any]) -> Any:  # noqa: ANN401 - rospy is not typed
        """Create a server of rospy and return it.

        Args:
            service: Full name of the service.
            service_class: Service class of rospy.
            handler: Called with each request; returns the response.

        Raises:
            NepError: The process already serves the service.
        """
        with self._lock:
            if self.rospy.impl.registration.get_service_manager().get_service(service) is not None:
                raise NepError(
                    _(
                        "this program already serves '{service}', and ROS allows only one server of a "
                        "service; close it first"
                    ).format(service=service)
                )
            return self.rospy.Service(service, service_class, handler)

    # ---- connections

    def peer_subscribe(self, *_arguments: object) -> None:
        """Handle a new connection to a publisher. Called by rospy."""
        with self.changed:
            self.changed.notify_all()

    def peer_unsubscribe(self, *_arguments: object) -> None:
        """Ignore a disconnected subscriber. Called by rospy."""

    def connected_nodes(self, publisher: Any) -> tuple[str, ...]:  # noqa: ANN401 - rospy is not typed
        """Return the names of the nodes that are connected to a publisher."""
        impl = publisher.impl
        return () if impl is None else tuple(str(each.endpoint_id) for each in impl.connections)

    def wait_for_subscribers(self, publisher: Any, topic: str, timeout_s: float) -> None:  # noqa: ANN401
        """Wait up to `timeout_s` seconds until all registered subscribers of a publisher are connected."""
        expected = set(self.master.names(topic, _REQUEST_TIMEOUT_S)[1])
        with self.changed:
            self.changed.wait_for(lambda: expected <= set(self.connected_nodes(publisher)), timeout_s)

    def wait_for_publishers(self, topic: str, timeout_s: float) -> None:
        """Wait up to `timeout_s` seconds until all publishers of a topic report a connection to this node.

        rospy's own list of connections isn't used, because it contains connections that aren't established
        yet.
        """
        deadline = time.monotonic() + timeout_s
        pause = threading.Event()
        uris = {
            name: self.uri if name == self.name else self.master.uri_of(name, _REQUEST_TIMEOUT_S)
            for name in self.master.names(topic, _REQUEST_TIMEOUT_S)[0]
        }
        for uri in filter(None, uris.values()):
            while (remaining_s := deadline - time.monotonic()) > 0.0 and not self._is_connected_to(
                uri, topic, remaining_s
            ):
                pause.wait(_POLL_S)

    def _is_connected_to(self, uri: str, topic: str, timeout_s: float) -> bool:
        if uri != self.uri:
            buses = connections_of(uri, timeout_s)
            return not buses or (self.name, "o", topic) in buses
        impl = self.rospy.topics.get_topic_manager().get_publisher_impl(topic)
        return impl is None or self.name in {each.endpoint_id for each in impl.connections}


def run_with_timeout(function: Callable[[], object], timeout_s: float) -> bool:
    """Run `function` in a thread and wait for its end, up to `timeout_s` seconds but at least 0.2 s.

    Needed because rospy's requests to a master have no timeout.

    Returns:
        False on timeout, or if no thread can be started because Python is exiting.
    """
    thread = threading.Thread(target=function, name="nep-ros-unregister", daemon=True)
    try:
        thread.start()
    except RuntimeError:  # Python 3.12 starts no threads at exit; rospy itself unregisters everything then
        return False
    thread.join(max(_MIN_TIMEOUT_S, timeout_s))
    return not thread.is_alive()


def _has_unsent_data(connection: Any) -> bool:  # noqa: ANN401 - rospy is not typed
    # True unless the connection's thread waits for data: messages it has taken from the queue are visible
    # nowhere else.
    condition = getattr(connection, "_cond_data_available", None)
    if condition is None or connection.done:
        return False
    with condition:
        return bool(connection._queue) or not condition._waiters  # noqa: SLF001


_process: RosProcess | None = None
_lock = threading.Lock()


def _forked() -> None:
    global _process, _lock
    _process, _lock = None, threading.Lock()


call_in_child(_forked)


def get_process(address: str, name: str, wait_s: float | None) -> RosProcess:
    """Return the process's ROS node; start it as `name` if there is none.

    Args:
        address: Address of the ROS master.
        name: Name for a new ROS node.
        wait_s: Seconds to wait for the master; None waits forever.

    Raises:
        MasterUnreachable: The ROS master didn't reply within `wait_s` seconds.
        NepError: The ROS node uses another master or was shut down.
    """
    global _process  # noqa: PLW0603 - one per process
    rospy = get_rospy()
    RosMaster(address).wait(wait_s)  # rospy itself would wait forever
    with _lock:
        if rospy.core.is_shutdown_requested():
            raise RosShutdownError
        if _process is None:
            _process = _start_process(rospy, address, name)
        if not _is_same_address(_process.master.address, address):
            raise NepError(
                _(
                    "this program is connected to the ROS master at '{known}', and ROS allows only one "
                    "master per program; use another program for '{address}'"
                ).format(known=_process.master.address, address=address)
            )
        return _process


def _is_same_address(address: str, other: str) -> bool:
    is_local = is_loopback_address(address) and is_loopback_address(other)
    return address == other or (is_local and address.rpartition(":")[2] == other.rpartition(":")[2])


def _set_own_address(master: str) -> None:
    # Adapts the user's settings of this computer's address for rospy. Raises `NepError`.
    for name in ("ROS_IP", "ROS_HOSTNAME"):
        if os.environ.get(name) == "":
            del os.environ[name]  # rospy would print a line for each connection
    ros_ip = os.environ.get("ROS_IP")
    if ros_ip is not None:
        try:
            ipaddress.ip_address(ros_ip)
        except ValueError:
            raise NepError(
                _("ROS_IP is '{value}'; set it to the IP address of this computer").format(
                    value=escaped(shortened(ros_ip, 100))
                )
            ) from None
    elif is_loopback_address(master) and "ROS_HOSTNAME" not in os.environ:
        os.environ["ROS_IP"] = "127.0.0.1"


def _start_process(rospy: Any, address: str, name: str) -> RosProcess:  # noqa: ANN401 - rospy is not typed
    if rospy.core.is_initialized():  # the program has started rospy itself
        process = RosProcess(rospy, ros_master_address(rospy.core.rosgraph.get_master_uri()))
        _defer_shutdown(process)
        return process
    os.environ["ROS_MASTER_URI"] = f"http://{address}"
    _set_own_address(address)
    node_name = _INVALID_CHARACTERS.sub("_", name).strip("_")
    node_name = node_name if node_name[:1].isalpha() else f"nep_{node_name}"
    configure_logging = rospy.core.configure_logging
    # it would replace the program's log configuration
    rospy.core.configure_logging = lambda *_args, **_keywords: None
    try:
        rospy.init_node(node_name[:100], anonymous=True, disable_signals=True)
    finally:
        rospy.core.configure_logging = configure_logging
    process = RosProcess(rospy, address)
    _defer_shutdown(process)
    for uri in (
        process.uri,
        f"http://{ros_master_address(process.uri).rpartition(':')[0]}:{_tcp_port(rospy)}",
    ):
        port = uri.rstrip("/").rpartition(":")[2]
        close_in_child(f"tcp://127.0.0.1:{port}", f"tcp://0.0.0.0:{port}")
    return process


def _defer_shutdown(process: RosProcess) -> None:
    # rospy's own hook would run before nodes have flushed, and would wait for a hung master.
    exit_handler = getattr(process.rospy.core, "_ros_atexit", None)
    if exit_handler is not None:
        atexit.unregister(exit_handler)

    pid = os.getpid()
    call_after_nodes(lambda: process.shut_down() if os.getpid() == pid else None)


def _tcp_port(rospy: Any) -> int:  # noqa: ANN401 - rospy is not typed
    # Starts rospy's TCPROS server if needed.
    rospy.impl.tcpros_base.start_tcpros_server()
    return int(rospy.impl.tcpros_base.get_tcpros_server_address()[1])
