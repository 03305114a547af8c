"""XML-RPC client for the ROS master, with timeouts. Works without rospy."""

from __future__ import annotations

import http.client
import threading
import time
import xmlrpc.client
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from xml.parsers.expat import ExpatError

from nep.errors import MasterUnreachable, NepError
from nep.i18n import _

_CALLER_ID = "/nep"
_REQUEST_TIMEOUT_S = 1.0
"""Timeout of a single request to a master in seconds."""
_RETRY_S = 0.1
_ROSPY_SERVICES = ("/get_loggers", "/set_logger_level")
"""Services that every ROS node provides."""
_REQUEST_ERRORS = (
    OSError, xmlrpc.client.Error, http.client.HTTPException, ExpatError, ValueError, TypeError, LookupError
)  # fmt: skip
"""Exceptions that mean a failed request, including replies of servers that aren't ROS masters."""


class RosMasterUnreachable(MasterUnreachable):
    """No ROS master replied at `address` within `waited_s` seconds."""

    def __init__(self, address: str, waited_s: float) -> None:
        self.address = address
        self.waited_s = waited_s
        self.is_known = True
        NepError.__init__(
            self,
            _(
                "no ROS master replied at '{address}' (waited {seconds:g} s); start one with 'roscore', or "
                "with 'rosmaster --core'"
            ).format(address=address, seconds=waited_s),
        )


class _Transport(xmlrpc.client.Transport):
    def __init__(self, timeout_s: float) -> None:
        super().__init__()
        self._timeout_s = timeout_s

    def make_connection(self, host: tuple[str, dict[str, str]] | str) -> http.client.HTTPConnection:
        connection = super().make_connection(host)
        connection.timeout = self._timeout_s
        return connection


class _RejectedError(ValueError): ...


def _call(uri: str, timeout_s: float, method: str, *args: object) -> Any:  # noqa: ANN401 - any value
    # Raises `_REQUEST_ERRORS`.
    with xmlrpc.client.ServerProxy(uri, transport=_Transport(max(0.01, timeout_s))) as proxy:
        code, status, value = getattr(proxy, method)(*args)
    if code != 1:
        raise _RejectedError(status)
    return value


def connections_of(uri: str, timeout_s: float) -> list[tuple[str, str, str]]:
    """Return a node's connections; empty if the node doesn't reply.

    Args:
        uri: Address of the node.
        timeout_s: Seconds to wait for the reply.

    Returns:
        (peer, direction, topic) of each connection; the direction is "i" (in) or "o" (out).
    """
    try:
        buses = _call(uri, timeout_s, "getBusInfo", _CALLER_ID)
        return [(str(each[1]), str(each[2]), str(each[4])) for each in buses]
    except _REQUEST_ERRORS:
        return []


@dataclass(frozen=True)
class RosSystemState:
    """Snapshot of a ROS master.

    Attributes:
        publishers: Names of the publishing nodes by topic.
        subscribers: Names of the subscribing nodes by topic.
        services: Names of the serving nodes by service.
        types: Message types by topic.
        uris: Addresses by node name.
    """

    publishers: Mapping[str, Sequence[str]]
    subscribers: Mapping[str, Sequence[str]]
    services: Mapping[str, Sequence[str]]
    types: Mapping[str, str]
    uris: Mapping[str, str]


@dataclass(frozen=True)
class NodeRegistrations:
    """Registrations of a node at the ROS master.

    Attributes:
        publications: (topic, type) of each publisher.
        subscriptions: (topic, type) of each subscriber.
        services: (service, address) of each server.
    """

    publications: Sequence[Sequence[str]]
    subscriptions: Sequence[Sequence[str]]
    services: Sequence[Sequence[str]]


class RosMaster:
    """Client for the ROS master at `address`.

    Methods raise `RosMasterUnreachable` if no reply arrives, unless they describe another result.
    """

    def __init__(self, address: str) -> None:
        self.address = address
        self.uri = f"http://{address}/"

    def wait(self, timeout_s: float | None) -> None:
        """Wait until the master replies.

        Raises `RosMasterUnreachable` after `timeout_s` seconds; None waits forever.
        """
        started_at = time.monotonic()
        pause = threading.Event()
        while True:
            waited_s = time.monotonic() - started_at
            request_timeout_s = (
                _REQUEST_TIMEOUT_S if timeout_s is None else min(_REQUEST_TIMEOUT_S, timeout_s - waited_s)
            )
            try:
                _call(self.uri, request_timeout_s, "getPid", _CALLER_ID)
                return
            except _REQUEST_ERRORS as error:
                waited_s = time.monotonic() - started_at
                if timeout_s is not None and waited_s + _RETRY_S >= timeout_s:
                    raise RosMasterUnreachable(self.address, timeout_s) from error
            pause.wait(_RETRY_S)

    def names(self, topic: str, timeout_s: float) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the names of a topic's publishing nodes and of its subscribing nodes."""
        state = self._request("getSystemState", timeout_s)
        node_names = [next((tuple(names) for each, names in part if each == topic), ()) for part in state[:2]]
        return node_names[0], node_names[1]

    def is_node_unknown(self, name: str, timeout_s: float) -> bool:
        """Return True if the master replies but doesn't list the node `name`, for example after a restart."""
        try:
            _call(self.uri, timeout_s, "lookupNode", _CALLER_ID, name)
        except _RejectedError:
            return True
        except _REQUEST_ERRORS:
            pass
        return False

    def register(self, name: str, uri: str, node: NodeRegistrations, timeout_s: float) -> bool:
        """Register a node again after a restart of the master; return False on failure.

        Args:
            name: Name of the node.
            uri: Address of the node.
            node: Registrations to repeat.
            timeout_s: Timeout of each request in seconds.
        """
        try:
            for topic, kind in node.publications:
                _call(self.uri, timeout_s, "registerPublisher", name, topic, kind, uri)
            for service, address in node.services:
                _call(self.uri, timeout_s, "registerService", name, service, address, uri)
            for topic, kind in node.subscriptions:
                publishers = _call(self.uri, timeout_s, "registerSubscriber", name, topic, kind, uri)
                _call(uri, timeout_s, "publisherUpdate", "/master", topic, publishers)
        except _REQUEST_ERRORS:
            return False
        return True

    def uri_of(self, name: str, timeout_s: float) -> str:
        """Return the address of a node, or "" if it is unknown or the master doesn't reply."""
        try:
            return str(_call(self.uri, timeout_s, "lookupNode", _CALLER_ID, name))
        except _REQUEST_ERRORS:
            return ""

    def system_state(self, timeout_s: float) -> RosSystemState:
        """Return a snapshot of the master, without the logger services of rospy."""
        state = self._request("getSystemState", timeout_s)
        publishers, subscribers, services = (
            {str(each): tuple(node_names) for each, node_names in part} for part in state[:3]
        )
        nodes_by_service = {
            name: nodes for name, nodes in services.items() if not name.endswith(_ROSPY_SERVICES)
        }
        types = {str(topic): str(kind) for topic, kind in self._request("getTopicTypes", timeout_s)}
        node_names = {
            name
            for part in (publishers, subscribers, nodes_by_service)
            for each in part.values()
            for name in each
        }
        return RosSystemState(
            publishers, subscribers, nodes_by_service, types, self._uris(sorted(node_names), timeout_s)
        )

    def services(self, timeout_s: float) -> tuple[str, ...]:
        """Return the names of services that have a server, without the logger services of rospy."""
        services = self._request("getSystemState", timeout_s)[2]
        return tuple(str(name) for name, _nodes in services if not str(name).endswith(_ROSPY_SERVICES))

    def service_uri(self, name: str, timeout_s: float) -> str:
        """Return the address of a service, or "" if it is unknown or the master doesn't reply."""
        try:
            return str(_call(self.uri, timeout_s, "lookupService", _CALLER_ID, name))
        except _REQUEST_ERRORS:
            return ""

    def _uris(self, names: Sequence[str], timeout_s: float) -> dict[str, str]:
        try:
            with xmlrpc.client.ServerProxy(self.uri, transport=_Transport(timeout_s)) as proxy:
                calls = xmlrpc.client.MultiCall(proxy)
                for name in names:
                    calls.lookupNode(_CALLER_ID, name)
                results: Any = calls() if names else []
                replies: list[Any] = [results[number] for number in range(len(names))]
        except _REQUEST_ERRORS:
            return {}
        return {name: str(each[2]) for name, each in zip(names, replies, strict=False) if each[0] == 1}

    def _request(self, method: str, timeout_s: float) -> Any:  # noqa: ANN401 - any value
        try:
            return _call(self.uri, timeout_s, method, _CALLER_ID)
        except _REQUEST_ERRORS as error:
            raise RosMasterUnreachable(self.address, timeout_s) from error
