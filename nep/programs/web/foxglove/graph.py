"""`GraphUpdates`: incremental updates of a client's view of the graph. Performs no I/O."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from nep.programs.web.foxglove.protocol import ENCODING
from nep.programs.web.messages.payloads import ros_type_of
from nep.programs.web.rosbridge.rosapi import is_visible
from nep.protocol.graph_view import GraphView

_MAX_SERVICES = 1_000
_SCHEMA = {"encoding": ENCODING, "schemaEncoding": "jsonschema", "schema": '{"type":"object"}'}
_Names = Mapping[str, tuple[str, ...]]


class _Connections(NamedTuple):
    """Names of the nodes that publish, subscribe to or serve each topic and service."""

    published: _Names
    subscribed: _Names
    services: _Names


_NO_CONNECTIONS = _Connections({}, {}, {})


class GraphUpdates:
    """State of the graph that was sent to a client, from which the next update is computed."""

    def __init__(self) -> None:
        self._service_ids: dict[tuple[str, str], int] = {}
        """Ids of services by (name, type)."""
        self._last_id = 0
        self._are_connections_enabled = False
        self._connections = _NO_CONNECTIONS

    def set_connections_enabled(self, *, is_enabled: bool) -> None:
        """Enable or disable updates about publishers, subscribers and servers.

        After being enabled, the first update contains all of them.
        """
        self._are_connections_enabled = is_enabled
        self._connections = _NO_CONNECTIONS

    def service_name(self, id_: int) -> str:
        """Return the name of the service with this id; "" if there is none."""
        return next(
            (name for (name, _type), service_id in self._service_ids.items() if service_id == id_), ""
        )

    def update(self, view: GraphView) -> list[dict[str, object]]:
        """Return the messages that update the client's view of the graph."""
        messages = self._update_services(view)
        if not self._are_connections_enabled:
            return messages
        previous, self._connections = self._connections, _connections(view)
        return [*messages, *_changes(previous, self._connections)]

    def _update_services(self, view: GraphView) -> list[dict[str, object]]:
        services_in_graph = (
            each for each in view.services.values() if each.servers and is_visible(each.name)
        )
        offered = [(each.name, ros_type_of(each.msg_type)) for each in services_in_graph][:_MAX_SERVICES]
        messages: list[dict[str, object]] = []
        removed = self._service_ids.keys() - set(offered)
        if removed:
            ids = [self._service_ids.pop(each) for each in removed]
            messages.append({"op": "unadvertiseServices", "serviceIds": ids})
        new_services = [each for each in offered if each not in self._service_ids]
        if new_services:
            services = [self._new_service(*each) for each in new_services]
            messages.append({"op": "advertiseServices", "services": services})
        return messages

    def _new_service(self, name: str, type_: str) -> dict[str, object]:
        self._last_id += 1
        self._service_ids[name, type_] = self._last_id
        return {
            "id": self._last_id,
            "name": name,
            "type": type_,
            "request": {**_SCHEMA, "schemaName": f"{type_}_Request"},
            "response": {**_SCHEMA, "schemaName": f"{type_}_Response"},
        }


def _connections(view: GraphView) -> _Connections:
    def names(ids: Iterable[str]) -> tuple[str, ...]:
        nodes = (view.nodes.get(each) for each in ids)
        return tuple(sorted({each.name for each in nodes if each is not None}))

    topics = [each for each in view.topics.values() if is_visible(each.name)]
    services = [each for each in view.services.values() if is_visible(each.name) and each.servers]
    return _Connections(
        {each.name: names(endpoint.node_id for endpoint in each.publishers) for each in topics},
        {each.name: names(endpoint.node_id for endpoint in each.subscribers) for each in topics},
        {each.name: names(endpoint.node_id for endpoint in each.servers) for each in services},
    )


def _changes(previous: _Connections, current: _Connections) -> list[dict[str, object]]:
    if previous == current:
        return []
    return [
        {
            "op": "connectionGraphUpdate",
            "publishedTopics": _changed_names(previous.published, current.published, "publisherIds"),
            "subscribedTopics": _changed_names(previous.subscribed, current.subscribed, "subscriberIds"),
            "advertisedServices": _changed_names(previous.services, current.services, "providerIds"),
            "removedTopics": sorted(previous.published.keys() - current.published.keys()),
            "removedServices": sorted(previous.services.keys() - current.services.keys()),
        }
    ]


def _changed_names(previous: _Names, current: _Names, field: str) -> list[dict[str, object]]:
    return [{"name": name, field: list(ids)} for name, ids in current.items() if previous.get(name) != ids]
