"""Transport of the back end `nanomsg`: messages over pynng, with the same master as `zeromq`.

Derived from the transport of `zeromq`: only the sockets differ; sessions, threads, waiting and closing
are shared.
"""

from __future__ import annotations

import time
from collections.abc import Callable

from nep.backends.base import PublisherSpec, PublisherTransport, SubscriberSpec, SubscriberTransport
from nep.backends.connection import Direct
from nep.backends.nanomsg.direct import DirectPublisher, DirectSubSocket, check_direct
from nep.backends.nanomsg.direct_services import DirectServices
from nep.backends.nanomsg.library import load_pynng
from nep.backends.nanomsg.publisher import NanomsgPublisher
from nep.backends.nanomsg.sub_socket import NanomsgSubSocket
from nep.backends.services import (
    ClientSpec,
    ClientTransport,
    ServerSpec,
    ServerTransport,
    SurveyTransport,
)
from nep.backends.zeromq.subscriber import NativeReadable, Readable, SocketSubscriber
from nep.backends.zeromq.transport import (
    DIRECT_WAIT_S,
    MasterPublisher,
    OwnedPublisher,
    ZeromqTransport,
    close_on_error,
)
from nep.protocol.requests import NodeRecord
from nep.protocol.service_wire import SURVEY_PREFIX
from nep.system.forks import close_in_child


class NanomsgTransport(ZeromqTransport):
    """Connection of one node over pynng. Raises `BackendUnavailableError` if pynng is not installed."""

    def __init__(self, node: NodeRecord) -> None:
        load_pynng()
        self._direct_services = DirectServices(node.name)
        super().__init__(node)

    def create_server(self, spec: ServerSpec) -> ServerTransport:
        """Create a server: REP or RESPONDENT for a direct connection, otherwise as in `ZeromqTransport`.

        A direct connection with wire "tcp" is also served by `ZeromqTransport`, except for surveys, for
        which `NepError` is raised.
        """
        direct = spec.configuration
        if isinstance(direct, Direct) and spec.service.startswith(SURVEY_PREFIX):
            check_direct(direct)
            return self._direct_services.create_respondent(spec, direct)
        if isinstance(direct, Direct) and direct.wire != "tcp":
            return self._direct_services.create_server(spec, direct)
        return super().create_server(spec)

    def create_client(self, spec: ClientSpec) -> ClientTransport:
        """Create a client: REQ for a direct connection, otherwise as in `ZeromqTransport`."""
        direct = spec.configuration
        if isinstance(direct, Direct) and direct.wire != "tcp":
            return self._direct_services.create_client(spec, direct)
        return super().create_client(spec)

    def create_surveyor(self, spec: ClientSpec) -> SurveyTransport:
        """Create a surveyor: SURVEYOR for a direct connection, otherwise as in `ZeromqTransport`."""
        if isinstance(spec.configuration, Direct):
            check_direct(spec.configuration)
            return self._direct_services.create_surveyor(spec, spec.configuration, DIRECT_WAIT_S)
        return super().create_surveyor(spec)

    def begin_close(self) -> None:
        """Notify all peers that the node is closing. Doesn't wait. See `Transport.begin_close`."""
        super().begin_close()
        self._direct_services.begin_close()

    def close(self, timeout_s: float) -> None:
        """Close all sockets and threads. See `Transport.close`."""
        deadline = time.monotonic() + timeout_s
        self._direct_services.close(timeout_s)
        super().close(max(0.0, deadline - time.monotonic()))

    def _give_up_in_child(self) -> None:
        super()._give_up_in_child()
        for publisher in self._publishers:
            if isinstance(publisher, NanomsgPublisher):
                close_in_child(*publisher.endpoints)

    def _new_publisher(
        self, spec: PublisherSpec, closer: Callable[[OwnedPublisher, float], None]
    ) -> MasterPublisher:
        return NanomsgPublisher(spec, closer, self._io.serve_soon)

    def _new_readable(self, spec: SubscriberSpec) -> NativeReadable:
        return NanomsgSubSocket(spec)

    def _create_direct_publisher(self, spec: PublisherSpec, direct: Direct) -> PublisherTransport:
        publisher = DirectPublisher(spec, direct, self._publisher_closer(lambda: None))
        with close_on_error(publisher.release):
            self._direct_endpoints[spec.id] = publisher.endpoint
            self._add_publisher(publisher)
        with close_on_error(lambda: publisher.close(0.0)):
            publisher.wait_for_any(DIRECT_WAIT_S)
        return publisher

    def _create_direct_subscriber(self, spec: SubscriberSpec, direct: Direct) -> SubscriberTransport:
        io = self._io_for(spec)
        readable = DirectSubSocket(spec, direct)
        subscriber: SocketSubscriber[Readable] = SocketSubscriber(
            readable, io, spec, self._discard_subscriber
        )
        with close_on_error(readable.close):
            self._direct_endpoints[spec.id] = readable.endpoint
            self._add_subscriber(subscriber)
        with close_on_error(subscriber.close):
            self._start_serving(io, subscriber)
        return subscriber
