"""The one ROS node of this process. All nodes of nep in it share it: rospy has one for a process, once.

It is named after the first of them and lives until the process ends. Nodes that close only unregister their
publishers and subscribers; after its end rospy could not be started again.
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

from nep.backends.ros.address import address_of, is_own_computer
from nep.backends.ros.definition import Definition
from nep.backends.ros.library import library
from nep.backends.ros.master import Registered, RosMaster, RosMasterUnreachable, buses_of
from nep.backends.ros.queue_room import QueueRoom
from nep.backends.ros.service_connection import Handshakes
from nep.errors import BadTopicError, ClosedError, NepError
from nep.i18n import _
from nep.system.exits import after_nodes
from nep.system.forks import give_up, in_child
from nep.text import escaped, shortened

__all__ = ["RosProcess", "RosShutdownError", "process_with", "ros_topic", "within"]

_logger = logging.getLogger("nep")

_NAME = re.compile(r"\W+", re.ASCII)
_TOPIC = re.compile(r"[~/A-Za-z][\w/]*", re.ASCII)
_POLL_S = 0.01
_ASK_S = 0.5
_WATCH_S = 1.0
"""So often it is seen whether the master was started anew."""
_LEAST_S = 0.2
"""A master that is well answers within this time, however little is left."""


def ros_topic(topic: str) -> str:
    """`topic` itself when ROS allows it. Raises `BadTopicError`."""
    if not _TOPIC.fullmatch(topic) or "//" in topic or topic.endswith(("/", "~")):
        raise BadTopicError(
            topic, _("in ROS a topic begins with a letter or '/', and has letters, digits, '_' and '/' only")
        )
    return topic


class RosShutdownError(ClosedError):
    """The ROS node of this program was shut down: by the program, by 'rosnode kill', by its name's next."""

    def __init__(self) -> None:
        self.what = "rospy"
        self.is_forked = False
        NepError.__init__(
            self,
            _("rospy was shut down in this program and cannot start in it again; start the program anew"),
        )


class RosProcess:
    """rospy, running. Its methods may be called from any thread."""

    def __init__(self, rospy: Any, address: str) -> None:  # noqa: ANN401 - rospy has no types
        self.rospy = rospy
        self.master = RosMaster(address)
        self.name: str = rospy.get_name()
        self.uri: str = rospy.get_node_uri()
        self.changed = threading.Condition()
        """Notified when somebody connects to a publisher."""
        self._lock = threading.RLock()
        self._seq_lock = threading.Lock()
        self._types: dict[str, tuple[str, int]] = {}
        self._classes: dict[str, type] = {}
        self._seqs: Counter[str] = Counter()
        self.subscribed: Counter[str] = Counter()
        """How many subscribers of nep's there are here, by topic."""
        self._published: dict[str, dict[int, Any]] = {}
        self.handshakes = Handshakes()
        self.at_shutdown: set[Callable[[], None]] = set()
        """Called when rospy is shut down before the program ends."""
        self._ended = threading.Event()
        rospy.on_shutdown(self._shut_down)
        threading.Thread(target=self._watch, name="nep-ros-master", daemon=True).start()

    @property
    def is_over(self) -> bool:
        """Whether rospy was shut down: nothing comes or goes any more."""
        return bool(self.rospy.core.is_shutdown_requested())

    def end(self) -> None:
        """Unregister all and shut rospy down. For the end of the program."""
        self._ended.set()
        try:
            self.master.wait(_ASK_S)
        except RosMasterUnreachable:
            return
        self.rospy.signal_shutdown("the program ends")

    def _shut_down(self) -> None:
        """Called by rospy, whoever asked for it."""
        if not self._ended.is_set():
            self._ended.set()
            _logger.warning("%s", RosShutdownError())
            for tell in list(self.at_shutdown):
                tell()

    def _watch(self) -> None:
        """Until rospy ends, see whether the master was started anew; in a thread."""
        while not self._ended.wait(_WATCH_S):
            if self.master.has_forgotten(self.name, _ASK_S) and self._register_anew():
                _logger.warning("the ROS master at '%s' was started anew", self.master.address)

    def _register_anew(self) -> bool:
        """Tell the master all that rospy told it, which rospy does not do again; whether it took it."""
        registration = self.rospy.impl.registration
        topics, services = registration.get_topic_manager(), registration.get_service_manager().get_services()
        with topics.lock:  # what is unregistered meanwhile must not be registered after that
            known = Registered(topics.get_publications(), topics.get_subscriptions(), services)
            return bool(known.publications or known.subscriptions or services) and self.master.register(
                self.name, self.uri, known, _ASK_S
            )

    def resolved(self, topic: str) -> str:
        """The full name of a topic."""
        return str(self.rospy.resolve_name(ros_topic(topic)))

    # ---- publishers

    def advertise(self, topic: str, definition: Definition, *, is_latched: bool, queue: int) -> Any:  # noqa: ANN401 - rospy has no types
        """Rospy's publisher on a full name. Raises `NepError` when the process has another type on it."""
        with self._lock:
            impl = self.rospy.impl.registration.get_topic_manager().get_publisher_impl(topic)
            own = definition.name if impl is None else impl.type  # the program's, such as that of /rosout
            known, users = self._types.get(topic, (own, 0))
            if known != definition.name:
                raise NepError(
                    _(
                        "this program publishes '{known}' on '{topic}', and ROS has one type for a topic of "
                        "a program; publish '{name}' on another topic"
                    ).format(known=known, topic=topic, name=definition.name)
                )
            made = self.rospy.Publisher(
                topic, self._class_of(definition), subscriber_listener=self, tcp_nodelay=True,
                latch=is_latched, queue_size=queue,
            )  # fmt: skip
            self._types[topic] = definition.name, users + 1
        return made

    def publishes(self, topic: str, id_: int, publisher: Any) -> None:  # noqa: ANN401 - rospy has no types
        """A publisher of nep's with this id is there, by what `advertise` made for it."""
        with self._lock:
            self._published.setdefault(topic, {})[id_] = publisher

    def publishes_no_more(self, topic: str, id_: int) -> None:
        """It is closed."""
        with self._lock:
            self._published.get(topic, {}).pop(id_, None)

    def publisher_on(self, topic: str) -> int | None:
        """The id of who publishes a topic in this process; None when it is not one publisher of nep's alone.

        ROS tells of a message only which process it is from.
        """
        with self._lock:
            found = self._published.get(topic, {})
            if len(found) != 1:
                return None
            ((id_, publisher),) = found.items()
            impl = publisher.impl
            return id_ if impl is not None and impl.ref_count == 1 else None

    def withdraw(self, topic: str, publisher: Any, timeout_s: float) -> None:  # noqa: ANN401 - rospy has no types
        """Unregister it."""
        if self.is_over or not within(publisher.unregister, timeout_s):
            return  # rospy still has the topic
        with self._lock:
            known, users = self._types[topic]
            self._types[topic] = known, users - 1
            if users == 1:
                del self._types[topic]

    def unsubscribe(self, subscriber: Any, timeout_s: float) -> None:  # noqa: ANN401 - rospy has no types
        """Unregister it."""
        if not self.is_over:
            within(subscriber.unregister, timeout_s)

    def unsent(self, publisher: Any, deadline: float) -> int:  # noqa: ANN401 - rospy has no types
        """Wait until rospy has sent what it queued; how many connections have some left at `deadline`."""
        impl = publisher.impl
        pause = threading.Event()
        while True:
            left = sum(_has_unsent(each) for each in ([] if impl is None else impl.connections))
            if not left or time.monotonic() >= deadline:
                return left
            pause.wait(_POLL_S)

    def send(self, publisher: Any, definition: Definition, topic: str, body: bytes, room: QueueRoom) -> int:  # noqa: ANN401
        """Publish a body; how many older ones were dropped, for a subscriber that takes none.

        In a header it gets the next number of its topic, as rospy gives it.
        """
        message = self._class_of(definition)()
        impl = publisher.impl
        with self._seq_lock:
            dropped = room.make([] if impl is None else impl.connections, len(body))
            if definition.has_header:
                self._seqs[topic] += 1
                body = (self._seqs[topic] & 0xFFFFFFFF).to_bytes(4, "little") + body[4:]
            message.body = body
            try:
                publisher.publish(message)
            except self.rospy.ROSException:  # it was shut down this moment
                raise RosShutdownError from None
        return dropped

    def _class_of(self, definition: Definition) -> type:
        """A class of messages that rospy sends as they are."""
        made = self._classes.get(definition.name)
        if made is None:
            genpy = self.rospy.msg.genpy
            known = genpy.message.get_message_class(definition.name)

            def serialize(message: Any, buffer: Any) -> None:  # noqa: ANN401 - rospy has no types
                buffer.write(message.body)

            made = self._classes[definition.name] = type(
                "EncodedMessage",
                (genpy.Message,),
                {
                    "__slots__": ["body"], "_slot_types": ["uint8[]"], "_has_header": False,
                    "_type": definition.name, "_md5sum": known._md5sum, "_full_text": definition.text,  # noqa: SLF001
                    "serialize": serialize,
                },
            )  # fmt: skip
        return made

    # ---- services

    def serve(self, service: str, kind: type, handler: Callable[[Any], Any]) -> Any:  # noqa: ANN401 - rospy has no types
        """Rospy's server on a full name. Raises `NepError` when the process has one of this name."""
        with self._lock:
            if self.rospy.impl.registration.get_service_manager().get_service(service) is not None:
                raise NepError(
                    _(
                        "this program serves '{service}' already, and ROS has one server of a name; close "
                        "it first"
                    ).format(service=service)
                )
            return self.rospy.Service(service, kind, handler)

    # ---- connections

    def peer_subscribe(self, *_told: object) -> None:
        """Called by rospy when somebody connected to a publisher."""
        with self.changed:
            self.changed.notify_all()

    def peer_unsubscribe(self, *_told: object) -> None:
        """Called by rospy when somebody disconnected from a publisher."""

    def hearers(self, publisher: Any) -> tuple[str, ...]:  # noqa: ANN401 - rospy has no types
        """Names of the nodes that are connected to a publisher."""
        impl = publisher.impl
        return () if impl is None else tuple(str(each.endpoint_id) for each in impl.connections)

    def wait_for_hearers(self, publisher: Any, topic: str, timeout_s: float) -> None:  # noqa: ANN401
        """Wait until all nodes whose subscribers are registered are connected."""
        expected = set(self.master.names(topic, _ASK_S)[1])
        with self.changed:
            self.changed.wait_for(lambda: expected <= set(self.hearers(publisher)), timeout_s)

    def wait_for_sources(self, topic: str, timeout_s: float) -> None:
        """Wait until all nodes that publish on a topic say that this one is connected to them.

        rospy's own side of a connection tells nothing: it is listed before it is there.
        """
        deadline = time.monotonic() + timeout_s
        pause = threading.Event()
        uris = {
            name: self.uri if name == self.name else self.master.uri_of(name, _ASK_S)
            for name in self.master.names(topic, _ASK_S)[0]
        }
        for uri in filter(None, uris.values()):
            while (left := deadline - time.monotonic()) > 0.0 and not self._is_heard_from(uri, topic, left):
                pause.wait(_POLL_S)

    def _is_heard_from(self, uri: str, topic: str, timeout_s: float) -> bool:
        if uri != self.uri:
            buses = buses_of(uri, timeout_s)
            return not buses or (self.name, "o", topic) in buses
        own = self.rospy.topics.get_topic_manager().get_publisher_impl(topic)
        return own is None or self.name in {each.endpoint_id for each in own.connections}


def within(call: Callable[[], object], timeout_s: float) -> bool:
    """Call it in a thread, and wait so long, whether it ended: rospy asks a master without a limit."""
    thread = threading.Thread(target=call, name="nep-ros-unregister", daemon=True)
    try:
        thread.start()
    except RuntimeError:  # Python 3.12 begins none while the program ends: then rospy itself unregisters all
        return False
    thread.join(max(_LEAST_S, timeout_s))
    return not thread.is_alive()


def _has_unsent(connection: Any) -> bool:  # noqa: ANN401 - rospy has no types
    """Whether a connection's thread does anything else than wait for something to send.

    rospy does not tell: what its thread took out of the queue is nowhere to be seen until it is sent.
    """
    data = getattr(connection, "_cond_data_available", None)
    if data is None or connection.done:
        return False
    with data:
        return bool(connection._queue) or not data._waiters  # noqa: SLF001


_process: RosProcess | None = None
_lock = threading.Lock()


def _forked() -> None:
    global _process, _lock
    _process, _lock = None, threading.Lock()


in_child(_forked)


def process_with(address: str, name: str, wait_s: float | None) -> RosProcess:
    """The process's ROS node, started for the node `name` if there is none yet.

    Raises `MasterUnreachable`, and `NepError` when it is connected with another master or was shut down.
    """
    global _process  # noqa: PLW0603 - one for the process
    rospy = library()
    RosMaster(address).wait(wait_s)  # rospy itself would wait for ever, and could not be asked again
    with _lock:
        if rospy.core.is_shutdown_requested():
            raise RosShutdownError
        if _process is None:
            _process = _started(rospy, address, name)
        if not _is_same(_process.master.address, address):
            raise NepError(
                _(
                    "this program is connected with the ROS master at '{known}', and ROS allows one for a "
                    "program; use another program for '{address}'"
                ).format(known=_process.master.address, address=address)
            )
        return _process


def _is_same(one: str, other: str) -> bool:
    is_local = is_own_computer(one) and is_own_computer(other)
    return one == other or (is_local and one.rpartition(":")[2] == other.rpartition(":")[2])


def _set_own_address(master: str) -> None:
    """See that rospy gets along with what the user said where this computer is. Raises `NepError`."""
    for name in ("ROS_IP", "ROS_HOSTNAME"):
        if os.environ.get(name) == "":
            del os.environ[name]  # rospy would print a line for each connection
    own = os.environ.get("ROS_IP")
    if own is not None:
        try:
            ipaddress.ip_address(own)
        except ValueError:
            raise NepError(
                _("the variable ROS_IP is '{value}'; set it to the IP address of this computer").format(
                    value=escaped(shortened(own, 100))
                )
            ) from None
    elif is_own_computer(master) and "ROS_HOSTNAME" not in os.environ:
        os.environ["ROS_IP"] = "127.0.0.1"


def _started(rospy: Any, address: str, name: str) -> RosProcess:  # noqa: ANN401 - rospy has no types
    if rospy.core.is_initialized():  # the program has started it itself
        found = RosProcess(rospy, address_of(rospy.core.rosgraph.get_master_uri()))
        _end_after_nodes(found)
        return found
    os.environ["ROS_MASTER_URI"] = f"http://{address}"
    _set_own_address(address)
    word = _NAME.sub("_", name).strip("_")
    word = word if word[:1].isalpha() else f"nep_{word}"
    configure = rospy.core.configure_logging
    rospy.core.configure_logging = lambda *_args, **_keywords: None  # it would take over the program's log
    try:
        rospy.init_node(word[:100], anonymous=True, disable_signals=True)
    finally:
        rospy.core.configure_logging = configure
    made = RosProcess(rospy, address)
    _end_after_nodes(made)
    for uri in (made.uri, f"http://{address_of(made.uri).rpartition(':')[0]}:{_tcp_port(rospy)}"):
        port = uri.rstrip("/").rpartition(":")[2]
        give_up(f"tcp://127.0.0.1:{port}", f"tcp://0.0.0.0:{port}")
    return made


def _end_after_nodes(process: RosProcess) -> None:
    """By itself rospy would end before nodes have delivered, and would wait for a hung master."""
    at_exit = getattr(process.rospy.core, "_ros_atexit", None)
    if at_exit is not None:
        atexit.unregister(at_exit)

    pid = os.getpid()
    after_nodes(lambda: process.end() if os.getpid() == pid else None)


def _tcp_port(rospy: Any) -> int:  # noqa: ANN401 - rospy has no types
    """The port at which its publishers are reached; it listens there from now on."""
    rospy.impl.tcpros_base.start_tcpros_server()
    return int(rospy.impl.tcpros_base.get_tcpros_server_address()[1])
