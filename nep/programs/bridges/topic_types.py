"""Selection of the message types with which a bridge subscribes and publishes."""

from __future__ import annotations

from collections.abc import Callable, Collection

from nep.backends.base import Backend
from nep.errors import NepError
from nep.messages.codecs import CODECS, JSON, Codec, JsonEncoder, codec_for, content_of
from nep.messages.encoded import Encoded
from nep.messages.message import Message
from nep.protocol.graph_view import GraphView, TopicInfo

_DEFAULT_TYPE = "json"
_UNKNOWN_TYPES = frozenset({"", "*"})


class TopicFormat:
    """Message type and encoder with which a route publishes."""

    def __init__(self, msg_type: str, codec: Codec, topic: str) -> None:
        self.msg_type = msg_type
        self.codec = codec
        self.encode: Callable[[object], Encoded] = codec.encode
        if codec is JSON:
            self.encode = JsonEncoder(topic).encode

    def matches(self, message: Message) -> bool:
        """Return True if a message can be published without being encoded again.

        The message must have the same codec and, for a codec of one back end only, the same message type.
        """
        if message.codec != self.codec.name:
            return False
        return message.codec in CODECS or message.msg_type == self.msg_type


def published_type(view: GraphView, topic: str, own_nodes: Collection[str]) -> str:
    """Return the message type with which nodes other than the bridge publish a topic.

    Returns "" if there are no such nodes or the type is unknown.

    Args:
        view: Graph of the network.
        topic: Name of the topic.
        own_nodes: Ids of the bridge's nodes.
    """
    topic_info = view.topics.get(topic)
    if topic_info is None or all(each.node_id in own_nodes for each in topic_info.publishers):
        return ""
    return "" if topic_info.msg_type in _UNKNOWN_TYPES else topic_info.msg_type


def default_type(backend: Backend) -> str:
    """Return the message type for subscribing to a topic that has no publisher yet.

    Returns "" if the back end needs the actual type.
    """
    return _DEFAULT_TYPE if backend.codec_for is codec_for else ""


def type_for(
    message: Message, backend: Backend, topic_info: TopicInfo | None, own_nodes: Collection[str]
) -> str:
    """Return the message type for publishing messages like `message` on a topic without configured type.

    A topic must not have two types. Therefore, the topic's existing type is used if other nodes use the
    topic and one of these conditions is met:

    - Only this back end knows the existing type, and the message may be a map.
    - Another node publishes the topic, with the codec of the message.

    Otherwise, the message's own type is used.

    Args:
        message: Message to forward.
        backend: Back end of the destination.
        topic_info: Topic in the destination's graph; None if it doesn't exist.
        own_nodes: Ids of the bridge's nodes.
    """
    own_type = _message_type(message, backend)
    if topic_info is None or topic_info.msg_type in _UNKNOWN_TYPES:
        return own_type
    node_ids = {each.node_id for each in topic_info.publishers} | {
        each.node_id for each in topic_info.subscribers
    }
    codec = _codec_name(backend, topic_info.msg_type)
    if node_ids <= set(own_nodes) or not codec:
        return own_type
    if codec not in CODECS:  # a type of the back end has fields
        return topic_info.msg_type if content_of(message.codec) == "values" else own_type
    is_published = any(each.node_id not in own_nodes for each in topic_info.publishers)
    has_same_codec = is_published and codec == _codec_name(backend, own_type)
    return topic_info.msg_type if has_same_codec else own_type


def _message_type(message: Message, backend: Backend) -> str:
    # A message keeps its type unless that would change its codec: an image of a ROS type is an `image`
    # elsewhere. A type that the back end should know but doesn't is kept, so that the back end reports it.
    is_kept = message.codec not in CODECS or _codec_name(backend, message.msg_type) in {"", message.codec}
    return message.msg_type if is_kept else message.codec


def _codec_name(backend: Backend, msg_type: str) -> str:
    try:
        return backend.codec_for(msg_type).name
    except NepError:
        return ""
