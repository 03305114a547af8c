"""Gateway as an attachment of a master, and its connection to the native network.

`NativeNetwork` owns a native node, registers original programs in the graph and reports their alerts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from nep.errors import BadTopicError, ClosedError, DecodeError, EncodeError, NepError, WaitTimeoutError
from nep.i18n import _, ngettext
from nep.masters.master import Master
from nep.messages import image_codec
from nep.messages.codecs import content_of
from nep.messages.image_files import parse_header
from nep.messages.message import Message
from nep.nodes.node import Node
from nep.nodes.publisher import Publisher
from nep.nodes.subscriber import Subscriber
from nep.programs.gateway.gateway import Gateway
from nep.programs.gateway.graph_registrar import GraphRegistrar
from nep.programs.gateway.inbox import NativeInbox
from nep.programs.gateway.portmap import default_file
from nep.programs.gateway.processes import SystemProcesses
from nep.programs.gateway.programs import OriginalProgram
from nep.programs.gateway.relay import Key
from nep.programs.gateway.request_server import Ports
from nep.protocol.graph_view import Alert, GraphView
from nep.protocol.requests import Reply, ReportAlerts, Request
from nep.system.descriptors import raise_open_file_limit
from nep.system.lazy_import import lazy_module
from nep.text import escaped

if TYPE_CHECKING:
    import psutil
else:
    psutil = lazy_module("psutil")

_JOIN_TIMEOUT_S = 3.0
"""Time limit in seconds for joining a master, which delays new nodes by a second after its start."""

_RETRY_S = 1.0
"""Time in seconds before a failed topic is retried. Each attempt blocks the gateway's thread."""
_MAX_ALERTS = 200
_SocketT = TypeVar("_SocketT", Publisher, Subscriber)


class GatewayAttachment:
    """Attachment of a master that lets programs of the original NEP join. Implements `Attachment`.

    Args:
        file: File that stores the ports of programs (default: `default_file`).
        ports: Fixed ports of the gateway (default: `Ports()`).
    """

    def __init__(self, file: Path | None = None, ports: Ports | None = None) -> None:
        self._file = file
        self._ports = ports
        self._gateway: Gateway | None = None

    def start(self, master: Master) -> None:
        """Start the gateway. A port that is in use is reported as an alert, not raised."""
        raise_open_file_limit()
        address = master.address

        def create_node() -> Node:
            return Node("gateway", master=address, generation="gateway", wait_s=_JOIN_TIMEOUT_S)

        def submit(request: Request) -> Reply | None:
            try:
                return master.submit(request)
            except (ClosedError, WaitTimeoutError):
                return None  # the master is closing

        def report(alerts: tuple[Alert, ...]) -> None:
            submit(ReportAlerts("gateway", alerts))

        native = NativeNetwork(create_node, GraphRegistrar(submit, master.epoch), report)
        file = self._file or default_file(int(address.rpartition(":")[2]))
        self._gateway = Gateway(
            native, SystemProcesses(), file, ports=self._ports, boot_time_s=psutil.boot_time()
        )
        self._gateway.start()

    def changed(self, view: GraphView) -> None:
        """Ignore a new graph, because the gateway polls its own sockets."""

    def close(self) -> None:
        """Stop the gateway and release its ports."""
        if self._gateway is not None:
            self._gateway.close()
            self._gateway = None


class NativeNetwork:
    """Connection of the gateway to the native network (see `GatewayNetwork`).

    Args:
        create_node: Creates the node when the first topic is forwarded, so that a master without original
            programs has no gateway node.
        registrar: Registrar of original programs in the graph.
        report: Publishes the current alerts.
    """

    def __init__(
        self,
        create_node: Callable[[], Node],
        registrar: GraphRegistrar,
        report: Callable[[tuple[Alert, ...]], None],
    ) -> None:
        self._create_node = create_node
        self._registrar = registrar
        self._report = report
        self._node: Node | None = None
        self._inbox: NativeInbox | None = None
        self._publishers: dict[Key, Publisher] = {}
        self._subscribers: dict[Key, Subscriber] = {}
        self._own_publisher_ids: frozenset[int] = frozenset()
        self._alerts: dict[str, Alert] = {}
        self._retry_at: dict[str, float] = {}
        self._reported_drop_count = 0

    # ---- messages

    def start(self, inbox: NativeInbox) -> None:
        """Set the inbox to which native messages are posted."""
        self._inbox = inbox

    def publish(self, topic: str, codec: str, data: bytes) -> None:
        """Publish data of an original program. The first call opens the publisher.

        If the publisher can't be opened, the data is dropped and an alert is reported. The first call after
        one second tries again.

        Args:
            topic: Name of the topic.
            codec: Native codec of the data.
            data: Encoded payload.
        """
        self._registrar.count((topic, codec), len(data))
        publisher = self._publishers.get((topic, codec))
        if publisher is None:
            publisher = self._open(topic, lambda node: node.new_pub(topic, codec))
            if publisher is None:
                return
            self._publishers[topic, codec] = publisher
            self._own_publisher_ids |= {publisher.id}
        publisher.publish_bytes(data, image_codec.image_info(data) if content_of(codec) == "image" else None)

    def stop_publishing(self, topic: str, codec: str) -> None:
        """Close the publisher of a topic."""
        publisher = self._publishers.pop((topic, codec), None)
        if publisher is not None:
            publisher.close()

    def subscribe(self, topic: str, codec: str) -> bool:
        """Subscribe to a topic; return False if the subscription failed."""
        subscriber = self._open(
            topic, lambda node: node.new_sub(topic, codec, sink=self._on_messages, wildcards=False)
        )
        if subscriber is None:
            return False
        self._subscribers[topic, codec] = subscriber
        return True

    def unsubscribe(self, topic: str, codec: str) -> None:
        """Close the subscriber of a topic."""
        subscriber = self._subscribers.pop((topic, codec), None)
        if subscriber is not None:
            subscriber.close()

    def data_of(self, message: Message) -> bytes | memoryview | None:
        """Return the data of a message in a form that original programs can decode.

        Images are encoded as JPEG or PNG. Returns None for an image for which that is impossible, and
        reports an alert.
        """
        if content_of(message.codec) != "image":
            return message.data
        try:
            if image_codec.raw_layout(message.extension.get("encoding")) is None:
                parse_header(message.data)  # reject decompression bombs: original programs decode anything
                return message.data
            encoded = image_codec.encode(message.payload)
            if image_codec.raw_layout((encoded.extension or {}).get("encoding")) is not None:
                raise EncodeError(
                    "image",
                    "array",
                    _("they support only JPEG and PNG, which can't store this number type"),
                )
            return encoded.data
        except (DecodeError, EncodeError) as error:
            self.report(
                f"message:{message.topic}",
                _("Programs of the original NEP don't receive the images of “{topic}”: {error}").format(
                    topic=message.topic, error=error
                ),
            )
            return None

    def _on_messages(self, messages: Sequence[Message]) -> None:
        # Runs in the node's thread: posts messages of other publishers to the gateway's thread.
        if self._inbox is not None:
            for message in messages:
                if message.publisher not in self._own_publisher_ids:
                    self._inbox.post(message)

    def _open(self, topic: str, create: Callable[[Node], _SocketT]) -> _SocketT | None:
        id = f"topic:{topic}"
        if time.monotonic() < self._retry_at.get(topic, 0.0):
            return None
        try:
            if self._node is None:
                self._node = self._create_node()
            endpoint = create(self._node)
        except NepError as error:
            now = time.monotonic()
            self._retry_at = {each: retry_at for each, retry_at in self._retry_at.items() if retry_at > now}
            self._retry_at[topic] = now + _RETRY_S
            reason, hint = str(error), ""
            if isinstance(error, BadTopicError):
                reason, hint = error.reason, _("Rename the topic.")
            self.report(
                id,
                _("“{topic}” isn't forwarded to native programs: {why}").format(topic=topic, why=reason),
                hint,
            )
            return None
        self._retry_at.pop(topic, None)
        self.resolve(id)
        return endpoint

    # ---- graph and alerts

    def set_programs(self, programs: tuple[OriginalProgram, ...]) -> None:
        """Register these original programs in the graph, and unregister all others."""
        self._registrar.set_programs(programs)

    def tick(self) -> None:
        """Send statistics to the master and report dropped messages. Call once a second."""
        self._registrar.renew()
        if self._inbox is not None and self._inbox.dropped != self._reported_drop_count:
            dropped_count = self._inbox.dropped - self._reported_drop_count
            self._reported_drop_count = self._inbox.dropped
            self.report(
                "gateway:full",
                ngettext(
                    "{count} message didn't reach programs of the original NEP in the last second",
                    "{count} messages didn't reach programs of the original NEP in the last second",
                    dropped_count,
                ).format(count=dropped_count),
            )
        else:
            self.resolve("gateway:full")

    def report(self, id: str, message: str, hint: str = "") -> None:
        """Report a problem as an alert. Repeated reports of the same problem have no effect.

        A new alert is dropped if there are 200 already.

        Args:
            id: Id of the alert, for `resolve`.
            message: Description of the problem.
            hint: Next step for the user, or "".
        """
        alert = Alert(escaped(id), escaped(message), escaped(hint))
        if self._alerts.get(id) != alert and (id in self._alerts or len(self._alerts) < _MAX_ALERTS):
            self._alerts[id] = alert
            self._report(tuple(self._alerts.values()))

    def resolve(self, id: str) -> None:
        """Remove the alert with this id, if there is one."""
        if self._alerts.pop(id, None) is not None:
            self._report(tuple(self._alerts.values()))

    def close(self) -> None:
        """Remove the original programs from the graph and close the node."""
        self._registrar.close()
        if self._node is not None:
            self._node.close()
