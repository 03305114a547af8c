"""`ServiceRegistry`: the servers and clients of one node."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TypeVar, cast

from nep.backends.base import Backend, Transport
from nep.backends.connection import Configuration
from nep.backends.services import CallQueue, ClientSpec, ServerSpec, ServiceTransport
from nep.errors import ClosedError, NepError
from nep.i18n import _
from nep.messages.codecs import Codec, codec_by_number
from nep.patterns.services.client import Client
from nep.patterns.services.server import Callback, Server
from nep.patterns.services.survey import Respondent, Surveyor
from nep.patterns.services.typed import CallTypes
from nep.protocol.service_wire import check_service, check_survey
from nep.system.arguments import (
    check_at_least,
    check_optional_time_limit,
    check_plain_function,
    check_type_name,
)

S = TypeVar("S", bound=Server)


class ServiceRegistry:
    """Factory and registry of a node's servers and clients, which are closed with the node. Thread-safe.

    Args:
        transport: Transport of the node.
        backend: Back end of the node.
        wait_s: Time limit for the master in seconds; None for no limit.
        new_id: Returns a new id and the number from which the id was derived.
        wake: Wakes the spinning thread.
        closed_error: Returns the exception to raise after the node was closed.
    """

    def __init__(
        self,
        transport: Transport,
        backend: Backend,
        wait_s: float | None,
        new_id: Callable[[], tuple[int, int]],
        wake: Callable[[], None],
        closed_error: Callable[[], ClosedError],
    ) -> None:
        self._closed_error = closed_error
        self._is_closed = False
        self._transport = transport
        self._backend = backend
        self._wait_s = wait_s
        self._new_id = new_id
        self._wake = wake
        self._lock = threading.Lock()
        self._servers: tuple[Server, ...] = ()
        self._clients: tuple[Client | Surveyor, ...] = ()
        self.has_servers = False
        """True if the node has servers.

        A plain attribute, because a spinning node reads it for every message.
        """

    def new_server(
        self,
        service: str,
        callback: Callback | None,
        configuration: Configuration,
        threads: int,
        msg_type: str,
        types: CallTypes,
    ) -> Server:
        """Create a server. See `Node.new_server`. Raises `NepError` if the back end has no services."""
        check_type_name("msg_type", msg_type)
        return self._create_server(
            Server, check_service(service), callback, configuration, threads, types, msg_type=msg_type
        )

    def new_respondent(
        self,
        survey: str,
        callback: Callback | None,
        configuration: Configuration,
        threads: int,
        types: CallTypes,
    ) -> Respondent:
        """Create a respondent. See `Node.new_respondent`."""
        self._survey_transport()
        return self._create_server(Respondent, check_survey(survey), callback, configuration, threads, types)

    def _create_server(
        self,
        kind: type[S],
        service: str,
        callback: Callback | None,
        configuration: Configuration,
        threads: int,
        types: CallTypes,
        *,
        msg_type: str = "json",
    ) -> S:
        if callback is not None:
            check_plain_function("callback", callback)
        check_at_least("threads", threads, 0)
        if threads and callback is None:
            raise ValueError(_("'threads' requires a callback"))
        transport = self._service_transport()
        id_, number = self._new_id()
        spec = ServerSpec(id_, service, configuration, self._wait_s, number, msg_type)
        server = kind(transport.create_server(spec), service, callback, threads, self._remove, types)
        with self._lock:
            self._servers = (*self._servers, server)
            self.has_servers = True
        self._close_if_node_closed(server)
        self._wake()  # a spinning thread serves its calls from now on
        return server

    def new_client(
        self,
        service: str,
        configuration: Configuration,
        msg_type: str,
        timeout_s: float | None,
        types: CallTypes,
    ) -> Client:
        """Create a client. See `Node.new_client`."""
        spec = self._client_spec(check_service(service), configuration, msg_type)
        limit_s = check_optional_time_limit("timeout_s", timeout_s)
        client = Client(
            self._service_transport().create_client(spec), service, spec.codec, limit_s, self._remove, types
        )
        with self._lock:
            self._clients = (*self._clients, client)
        self._close_if_node_closed(client)
        return client

    def new_surveyor(
        self,
        survey: str,
        configuration: Configuration,
        msg_type: str,
        timeout_s: float | None,
        types: CallTypes,
    ) -> Surveyor:
        """Create a surveyor. See `Node.new_surveyor`."""
        spec = self._client_spec(check_survey(survey), configuration, msg_type)
        limit_s = check_optional_time_limit("timeout", timeout_s)
        transport = self._survey_transport()
        surveyor = Surveyor(
            transport.create_surveyor(spec), spec.service, spec.codec, limit_s, self._remove, types
        )
        with self._lock:
            self._clients = (*self._clients, surveyor)
        self._close_if_node_closed(surveyor)
        return surveyor

    def _close_if_node_closed(self, server_or_client: Server | Client | Surveyor) -> None:
        # Raises `ClosedError`. The node may have been closed concurrently, without this object in its
        # registry.
        if self._is_closed:
            server_or_client.close()
            raise self._closed_error()

    def _client_spec(self, service: str, configuration: Configuration, msg_type: str) -> ClientSpec:
        codec_of = self._backend.call_codec_for or self._backend.codec_for
        codec = check_call_codec(codec_of(check_type_name("msg_type", msg_type)))
        id_, number = self._new_id()
        return ClientSpec(id_, service, codec, configuration, self._wait_s, number, msg_type)

    def _service_transport(self) -> ServiceTransport:
        if not hasattr(self._transport, "create_server"):
            raise NepError(
                _("the back end '{backend}' doesn't support services; use 'zeromq'").format(
                    backend=self._backend.name
                )
            )
        return cast("ServiceTransport", self._transport)

    def _survey_transport(self) -> ServiceTransport:
        transport = self._service_transport()
        if not hasattr(transport, "create_surveyor"):
            raise NepError(
                _("the back end '{backend}' doesn't support surveys; use 'zeromq'").format(
                    backend=self._backend.name
                )
            )
        return transport

    def _remove(self, server_or_client: Server | Client | Surveyor) -> None:
        with self._lock:
            self._servers = tuple(each for each in self._servers if each is not server_or_client)
            self.has_servers = bool(self._servers)
            self._clients = tuple(each for each in self._clients if each is not server_or_client)

    # ---- spinning

    @property
    def queues(self) -> list[CallQueue]:
        """Queues of the calls that the spinning thread serves."""
        return [
            queue for each in self._servers if (queue := each.spin_queue) is not None and not each.is_closed
        ]

    def run(self, stop_event: threading.Event) -> bool:
        """Serve one call per server in the spinning thread; return True if a call was served.

        Args:
            stop_event: Event that stops the method before the next server.
        """
        has_run = False
        for server in self._servers:
            if stop_event.is_set():
                break
            if server.spin_queue is not None and not server.is_closed:
                has_run = server.run_one() or has_run
        return has_run

    # ---- closing

    def finish_calls(self, timeout_s: float) -> None:
        """Wait at most `timeout_s` seconds for calls that are executed by the servers' own threads.

        Call this after the transport has stopped accepting calls.
        """
        deadline = time.monotonic() + timeout_s
        with self._lock:
            self._is_closed = True
        for server in self._servers:
            server.join(max(0.0, deadline - time.monotonic()))

    def stop_threads(self, timeout_s: float) -> None:
        """Stop the threads of all servers and clients.

        Call this after the transport has closed its sockets.

        Args:
            timeout_s: Time limit in seconds for the callbacks that run in the servers' threads.
        """
        deadline = time.monotonic() + timeout_s
        with self._lock:
            servers, self._servers = self._servers, ()
            clients, self._clients = self._clients, ()
        for server in servers:
            server.join(max(0.0, deadline - time.monotonic()))
        for client in clients:
            if isinstance(client, Client):
                client.join()


def check_call_codec(codec: Codec) -> Codec:
    """Return `codec` if services support it; raise `NepError` otherwise."""
    if codec.content == "image":
        raise NepError(_("a call can't contain an image; publish it on a topic"))
    if codec_by_number(codec.number) is not codec:  # a back end's codec without a number
        raise NepError(
            _("the type '{name}' can't be used for calls; use 'json' or 'msgpack'").format(name=codec.name)
        )
    return codec
