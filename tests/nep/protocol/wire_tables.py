"""Tables of fields in docs/wire.md, generated from the protocol's classes."""

from __future__ import annotations

from collections.abc import Mapping
from types import NoneType, UnionType
from typing import Any, Union, get_args, get_origin

from msgspec import NODEFAULT
from msgspec.structs import FieldInfo, fields

from nep.protocol import graph_view, requests

TABLES: Mapping[str, type] = {
    "node": requests.NodeRecord,
    "publisher": requests.PublisherRecord,
    "subscriber": requests.SubscriberRecord,
    "remote publisher": requests.RemotePublisher,
    "expected subscriber": requests.ExpectedSubscriber,
    "topic publishers": requests.TopicPublishers,
    "publisher statistics": requests.PublisherCount,
    "subscriber statistics": requests.SubscriberCount,
    "publisher+": requests.AddPublisher,
    "subscriber+": requests.AddSubscriber,
    "join": requests.Join,
    "publisher-": requests.RemovePublisher,
    "subscriber-": requests.RemoveSubscriber,
    "leave": requests.Leave,
    "renew": requests.Renew,
    "missing": requests.ReportMissing,
    "listen": requests.Listen,
    "added": requests.AddedReply,
    "found": requests.FoundReply,
    "renewed": requests.RenewedReply,
    "refused": requests.RejectedReply,
    "push publisher+": requests.PublisherAdded,
    "push publisher-": requests.PublisherRemoved,
    "seen": requests.GraphReply,
    "view": graph_view.GraphView,
    "node info": graph_view.NodeInfo,
    "topic info": graph_view.TopicInfo,
    "publisher info": graph_view.PublisherInfo,
    "subscriber info": graph_view.SubscriberInfo,
    "pattern info": graph_view.PatternInfo,
    "service info": graph_view.ServiceInfo,
    "server info": graph_view.ServerInfo,
    "client info": graph_view.ClientInfo,
    "alert": graph_view.Alert,
}
_NAMES = {kind: name for name, kind in TABLES.items()}
_PLAIN = {str: "text", int: "integer", bool: "boolean", float: "number"}
_OF_ALL = {"epoch", "revision"}


def rows(name: str) -> list[tuple[str, str, str]]:
    """Return field, type and default of each field, without `epoch` and `revision` of replies and pushes."""
    kind = TABLES[name]
    names = {each.name for each in fields(kind)}
    is_answer = names >= {"epoch", "revision"} and name not in {"renew", "view"}
    return [
        (each.name, _type(each.type), _default(each))
        for each in fields(kind)
        if not (is_answer and each.name in _OF_ALL)
    ]


def _type(hint: Any) -> str:
    if hint in _PLAIN:
        return _PLAIN[hint]
    if hint in _NAMES:
        return f"*{_NAMES[hint]}*"
    origin, args = get_origin(hint), get_args(hint)
    if origin in {UnionType, Union}:
        (inner,) = (each for each in args if each is not NoneType)
        return f"{_type(inner)} or nil"
    if origin is tuple:
        return f"list of {_type(args[0])}"
    return f"map: {_type(args[0])} → {_type(args[1])}"


def _default(field: FieldInfo) -> str:
    if field.default_factory is not NODEFAULT:
        return "empty"
    if field.default is NODEFAULT:
        return "required"
    if field.default is None:
        return "nil"
    if field.default in ("", ()):
        return "empty"
    if isinstance(field.default, bool):
        return str(field.default).lower()
    return f"{field.default:g}" if isinstance(field.default, float) else f"{field.default}"
