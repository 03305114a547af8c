"""Services of rosapi, through which roslib, roslibpy and Foxglove query the graph.

Parameters are named ``NODE:PARAMETER``, as in rosapi of ROS 2; their values are JSON texts.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import cached_property

import orjson

from nep.errors import NepError
from nep.i18n import _
from nep.nodes.node import Node
from nep.patterns.parameters.node_parameters import parameters_topic
from nep.programs.web.messages.payloads import ros_type_of
from nep.programs.web.messages.ros_definitions import (
    JSON_TYPE,
    bare_type,
    full_definition_text,
    type_definitions,
)
from nep.protocol.graph_view import GraphView, NodeInfo
from nep.text import bounded_str, quotable

PREFIX = "/rosapi/"
_HIDDEN_PREFIX = "/nep/"
_GRAPH_TIMEOUT_S = 2.0
_PARAMETER_TIMEOUT_S = 2.0
_NAMES_TIMEOUT_S = 5.0
_MAX_NODES_QUERIED = 50
_NS_PER_S = 1_000_000_000


def is_rosapi(service: str) -> bool:
    """Return True if a service belongs to rosapi, with or without the leading slash (roslib omits it)."""
    return f"/{service.removeprefix('/')}".startswith(PREFIX)


def is_visible(name: str) -> bool:
    """Return False for topics and services that are internal to NEP (below /nep/)."""
    return not name.startswith(_HIDDEN_PREFIX)


class RosApi:
    """Handler of one call to rosapi. Queries the graph at most once, when it is needed.

    Services return the fields of their reply, and raise `NepError` for invalid arguments.
    """

    def __init__(self, node: Node, motion_denial_reason: Callable[[str, str], str]) -> None:
        """Initialize the handler.

        Args:
            node: Node of the page.
            motion_denial_reason: Returns the reason why the page may not publish (topic, message type), or
                "".
        """
        self._node = node
        self._motion_denial_reason = motion_denial_reason

    def execute(self, service: str, args: object) -> Mapping[str, object]:
        """Execute a service of rosapi and return the fields of its reply.

        Raises `NepError` if the service isn't supported or fails.
        """
        name = f"/{service.removeprefix('/')}".removeprefix(PREFIX)
        entry = _SERVICES.get(name)
        if entry is None:
            raise NepError(
                _("the rosapi service '{service}' isn't supported here").format(service=quotable(service))
            )
        return entry[1](self, args if isinstance(args, Mapping) else {})

    @cached_property
    def _view(self) -> GraphView:
        return self._node.graph(_GRAPH_TIMEOUT_S)

    @cached_property
    def _types(self) -> dict[str, str]:
        """ROS types by topic, without topics internal to NEP."""
        topics = self._view.topics.values()
        return {each.name: ros_type_of(each.msg_type) for each in topics if is_visible(each.name)}

    def _node_name(self, node_id: str) -> str:
        node = self._view.nodes.get(node_id)
        return node_id if node is None else node.name

    # ---- topics

    def topics(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return all topics with their types."""
        return {"topics": list(self._types), "types": list(self._types.values())}

    def topic_rates(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return all topics with types, messages per second and bytes per second.

        This service is an extension of rosapi. A rate is None if it is not known yet.
        """
        topic_infos = [self._view.topics[each] for each in self._types]
        return {
            **self.topics({}),
            "rates": [each.rate_hz for each in topic_infos],
            "bandwidths": [each.bandwidth_Bps for each in topic_infos],
        }

    def topics_for_type(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the topics of a type."""
        requested_type = bare_type(_text(args, "type"))
        return {"topics": [topic for topic, ros_type in self._types.items() if ros_type == requested_type]}

    def topic_type(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the type of a topic; "" if the topic doesn't exist."""
        return {"type": self._types.get(_text(args, "topic"), "")}

    def topics_and_raw_types(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return all topics with their types and the definitions of the types.

        A type without a definition gets the definition of ``nep/Json``.
        """
        texts = [
            full_definition_text(each) or full_definition_text(JSON_TYPE) for each in self._types.values()
        ]
        return {**self.topics(args), "typedefs_full_text": texts}

    def publishers(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names of the nodes that publish a topic."""
        topic = self._view.topics.get(_text(args, "topic"))
        publishers = () if topic is None else topic.publishers
        return {"publishers": list(dict.fromkeys(self._node_name(each.node_id) for each in publishers))}

    def subscribers(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names of the nodes that subscribe to a topic."""
        topic = self._view.topics.get(_text(args, "topic"))
        subscribers = () if topic is None else topic.subscribers
        return {"subscribers": list(dict.fromkeys(self._node_name(each.node_id) for each in subscribers))}

    def message_details(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the fields of a message type."""
        type_name = _text(args, "type")
        definitions = type_definitions(bare_type(type_name))
        if definitions is None:
            raise NepError(_("the fields of '{type}' are unknown").format(type=quotable(type_name)))
        return {"typedefs": definitions}

    # ---- services

    def services(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names of all services that have a server, and of rosapi's own services."""
        return {"services": [*self._served_services, *(f"{PREFIX}{each}" for each in _SERVICES)]}

    @property
    def _served_services(self) -> list[str]:
        services = self._view.services.values()
        return [each.name for each in services if each.servers and is_visible(each.name)]

    def service_type(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the type of a service, also of rosapi's own services; "" if the service is unknown."""
        return {"type": self._service_type(_text(args, "service"))}

    def _service_type(self, service: str) -> str:
        if is_rosapi(service):
            entry = _SERVICES.get(f"/{service.removeprefix('/')}".removeprefix(PREFIX))
            return "" if entry is None else f"rosapi/{entry[0]}"
        known_service = self._view.services.get(service)
        return "" if known_service is None else ros_type_of(known_service.msg_type)

    def services_for_type(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the services of a type."""
        requested_type = _text(args, "type")
        names = [*self._served_services, *(f"{PREFIX}{each}" for each in _SERVICES)]
        return {"services": [each for each in names if self._service_type(each) == requested_type]}

    def service_providers(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names of the nodes that serve a service."""
        return {"providers": self._nodes_serving(_text(args, "service"))}

    def service_node(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the name of the first node that serves a service; "" if the service has no server."""
        return {"node": next(iter(self._nodes_serving(_text(args, "service"))), "")}

    def _nodes_serving(self, service: str) -> list[str]:
        info = self._view.services.get(service)
        servers = () if info is None else info.servers
        return list(dict.fromkeys(self._node_name(each.node_id) for each in servers))

    def service_details(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return a type definition without fields, because services of NEP have no schema."""
        type_name = _text(args, "type")
        empty: list[str] = []
        field_names = ("fieldnames", "fieldtypes", "fieldarraylen", "examples", "constnames", "constvalues")
        return {"typedefs": [{"type": type_name, **dict.fromkeys(field_names, empty)}]}

    # ---- nodes

    def nodes(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names of all nodes."""
        return {"nodes": list(dict.fromkeys(each.name for each in self._view.nodes.values()))}

    def node_details(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the topics that a node publishes and subscribes to, and the services that it serves."""
        ids = {each.id for each in self._nodes_named(_text(args, "node"))}
        topics, services = self._view.topics.values(), self._view.services.values()
        return {
            "subscribing": [each.name for each in topics if _has_member(each.subscribers, ids)],
            "publishing": [each.name for each in topics if _has_member(each.publishers, ids)],
            "services": [each.name for each in services if _has_member(each.servers, ids)],
        }

    def _nodes_named(self, name: str) -> list[NodeInfo]:
        nodes = [each for each in self._view.nodes.values() if name in {each.name, each.id}]
        if not nodes:
            raise NepError(_("unknown node '{name}'").format(name=quotable(name)))
        return nodes

    # ---- parameters

    def get_param_names(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the names of all parameters as ``NODE:PARAMETER``.

        Nodes that don't reply within the time limit are omitted. At most 50 nodes are queried, for at most
        5 s in total.
        """
        nodes = [
            node for node in self._view.nodes.values() if parameters_topic(node.id) in self._view.services
        ]
        names: list[str] = []
        deadline = time.monotonic() + _NAMES_TIMEOUT_S
        for node in nodes[:_MAX_NODES_QUERIED]:
            if time.monotonic() > deadline:
                break
            try:
                with self._node.parameters_of(node.id, _PARAMETER_TIMEOUT_S) as remote:
                    names += [
                        f"{node.name}:{bounded_str(parameter.get('name'))}" for parameter in remote.list()
                    ]
            except NepError:
                continue  # the node has left or does not respond
        return {"names": names}

    def get_param(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the value of a parameter as JSON text, or the default given in the request."""
        default = args.get("default")
        try:
            node, name = _parse_parameter_name(args)
            with self._node.parameters_of(node, _PARAMETER_TIMEOUT_S) as remote:
                return {"value": orjson.dumps(remote.get(name)).decode()}
        except NepError:
            if isinstance(default, str) and default:
                return {"value": default}
            raise

    def has_param(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Return {"exists": True} if a parameter exists, else {"exists": False}."""
        try:
            self.get_param({"name": args.get("name")})
        except NepError:
            return {"exists": False}
        return {"exists": True}

    def set_param(self, args: Mapping[str, object]) -> Mapping[str, object]:
        """Set a parameter to a value given as JSON text.

        For the node of a robot, the page needs permission to move the robot.
        """
        node, name = _parse_parameter_name(args)
        try:
            value = orjson.loads(_text(args, "value"))
        except orjson.JSONDecodeError:
            raise NepError(_('a parameter value must be JSON text, such as 0.5 or "slow"')) from None
        ids = {each.id for each in self._nodes_named(node)}
        for topic in self._view.topics.values():
            if not _has_member(topic.subscribers, ids):
                continue
            if reason := self._motion_denial_reason(topic.name, topic.msg_type):
                raise NepError(reason)
        with self._node.parameters_of(node, _PARAMETER_TIMEOUT_S) as remote:
            remote.set(name, value)
        return {}

    def delete_param(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Raise `NepError`, because parameters are declared by their node and can't be deleted."""
        raise NepError(_("parameters are declared by their node and can't be deleted"))

    # ---- others

    def action_servers(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return an empty list, because NEP has no ROS actions."""
        return {"action_servers": []}

    def get_time(self, _args: Mapping[str, object]) -> Mapping[str, object]:
        """Return the current time of this computer."""
        secs, nsecs = divmod(time.time_ns(), _NS_PER_S)
        return {"time": {"secs": secs, "nsecs": nsecs}}


def _text(args: Mapping[str, object], name: str) -> str:
    value = args.get(name)
    if not isinstance(value, str):
        raise NepError(_("this service needs '{name}', a string").format(name=name))
    return value


def _parse_parameter_name(args: Mapping[str, object]) -> tuple[str, str]:
    full_name = _text(args, "name")
    node, colon, name = full_name.rpartition(":")
    if not colon or not node:
        raise NepError(
            _("'{name}' isn't a valid parameter name; use the form 'NODE:PARAMETER'").format(
                name=quotable(full_name)
            )
        )
    return node.removeprefix("/"), name


def _has_member(members: tuple[object, ...], node_ids: set[str]) -> bool:
    return any(getattr(each, "node_id", "") in node_ids for each in members)


_Service = Callable[[RosApi, Mapping[str, object]], Mapping[str, object]]
_SERVICES: Mapping[str, tuple[str, _Service]] = {
    "topics": ("Topics", RosApi.topics),
    "topic_rates": ("TopicRates", RosApi.topic_rates),
    "topics_for_type": ("TopicsForType", RosApi.topics_for_type),
    "topic_type": ("TopicType", RosApi.topic_type),
    "topics_and_raw_types": ("TopicsAndRawTypes", RosApi.topics_and_raw_types),
    "publishers": ("Publishers", RosApi.publishers),
    "subscribers": ("Subscribers", RosApi.subscribers),
    "message_details": ("MessageDetails", RosApi.message_details),
    "services": ("Services", RosApi.services),
    "services_for_type": ("ServicesForType", RosApi.services_for_type),
    "service_type": ("ServiceType", RosApi.service_type),
    "service_providers": ("ServiceProviders", RosApi.service_providers),
    "service_node": ("ServiceNode", RosApi.service_node),
    "service_request_details": ("ServiceRequestDetails", RosApi.service_details),
    "service_response_details": ("ServiceResponseDetails", RosApi.service_details),
    "nodes": ("Nodes", RosApi.nodes),
    "node_details": ("NodeDetails", RosApi.node_details),
    "get_param_names": ("GetParamNames", RosApi.get_param_names),
    "get_param": ("GetParam", RosApi.get_param),
    "has_param": ("HasParam", RosApi.has_param),
    "set_param": ("SetParam", RosApi.set_param),
    "delete_param": ("DeleteParam", RosApi.delete_param),
    "action_servers": ("GetActionServers", RosApi.action_servers),
    "get_time": ("GetTime", RosApi.get_time),
}
