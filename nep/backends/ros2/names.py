"""Names in ROS 2 and DDS: topics, types, services and USER_DATA entries."""

from __future__ import annotations

import re
from collections.abc import Mapping

from nep.errors import BadTopicError, NepError
from nep.i18n import _
from nep.text import quotable

_TOPIC = re.compile(r"/?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_TYPE = re.compile(r"([A-Za-z]\w*)(/msg)?/([A-Z]\w*)", re.ASCII)
_DDS_TYPE = re.compile(r"(\w+)::msg::dds_::(\w+)_", re.ASCII)
_PARAMETER_TOPIC = re.compile(r"(/?nep/parameters/)(\d[0-9a-f]{15})", re.ASCII)
"""Pattern for nep's parameter topics of nodes whose id starts with a digit.

Such names need an escape, because ROS 2 allows no digit after "/".
"""
_ROS_PARAMETER_TOPIC = re.compile(r"(/nep/parameters/)_(\d[0-9a-f]{15})", re.ASCII)
_SERVICE_TYPE = re.compile(r"([A-Za-z]\w*)(/srv)?/([A-Z]\w*)", re.ASCII)
_DDS_REQUEST = re.compile(r"(\w+)::srv::dds_::(\w+)_Request_", re.ASCII)
_REQUEST_TOPIC = re.compile(r"rq(/.+)Request", re.ASCII)
_INVALID_CHARACTERS = re.compile(r"\W", re.ASCII)


def dds_topic(topic: str) -> str:
    """Return the DDS name of a topic: `rt/chatter` for "chatter" and "/chatter". Raises `BadTopicError`.

    In nep's parameter topics, a node id that starts with a digit is escaped with "_".
    """
    match = _PARAMETER_TOPIC.fullmatch(topic)
    if match is not None:
        topic = f"{match[1]}_{match[2]}"
    if _TOPIC.fullmatch(topic) is None or "__" in topic:
        raise BadTopicError(
            topic,
            _(
                "ROS 2 allows only ASCII letters, digits, '/' and '_', no digit after '/' and no '__'; "
                "choose another name"
            ),
        )
    return f"rt/{topic.removeprefix('/')}"


def ros_topic(topic: str) -> str | None:
    """Return the ROS name of a DDS topic: `/chatter` for "rt/chatter"; None for topics outside ROS 2."""
    return _restore_parameter_topic(topic[2:]) if topic.startswith("rt/") else None


def _restore_parameter_topic(name: str) -> str:
    # Removes the "_" that `dds_topic` inserts into parameter topics.
    match = _ROS_PARAMETER_TOPIC.fullmatch(name)
    return name if match is None else f"{match[1]}{match[2]}"


def is_type_name(msg_type: str) -> bool:
    """Return True for a ROS type name: "std_msgs/msg/String" or "std_msgs/String"."""
    return _TYPE.fullmatch(msg_type) is not None


def type_name(msg_type: str) -> str:
    """Return the full name of a message type, such as `std_msgs/msg/String`.

    Accepts "std_msgs/msg/String" and "std_msgs/String". Raises `NepError` for other names.
    """
    match = _TYPE.fullmatch(msg_type)
    if match is None:
        raise NepError(
            _("'{name}' isn't a ROS message type; use a name such as 'std_msgs/msg/String'").format(
                name=quotable(msg_type)
            )
        )
    return f"{match[1]}/msg/{match[3]}"


def dds_type(ros_type: str) -> str:
    """Return the DDS name of a ROS type, such as `std_msgs::msg::dds_::String_`."""
    package, kind, name = ros_type.split("/")
    return f"{package}::{kind}::dds_::{name}_"


def dds_service(service: str) -> tuple[str, str]:
    """Return the DDS topics for requests and responses of a service.

    For "add" and "/add" these are `rq/addRequest` and `rr/addReply`. Raises `BadTopicError`.
    """
    name = dds_topic(service).removeprefix("rt/")
    return f"rq/{name}Request", f"rr/{name}Reply"


def ros_service(topic: str) -> str | None:
    """Return the service of a request topic: `/add` for "rq/addRequest"; None for other DDS topics."""
    match = _REQUEST_TOPIC.fullmatch(topic)
    return None if match is None else _restore_parameter_topic(match[1])


def service_type_of(dds_type: str) -> str | None:
    """Return the service type whose requests have this DDS type, such as `std_srvs/srv/SetBool`.

    Returns None for other DDS types.
    """
    match = _DDS_REQUEST.fullmatch(dds_type)
    return None if match is None else f"{match[1]}/srv/{match[2]}"


def service_type_name(msg_type: str) -> str | None:
    """Return the full name of a service type, such as `std_srvs/srv/SetBool`.

    Accepts "std_srvs/srv/SetBool" and "std_srvs/SetBool"; returns None for other names.
    """
    match = _SERVICE_TYPE.fullmatch(msg_type)
    return None if match is None else f"{match[1]}/srv/{match[3]}"


def ros_type(dds_type: str) -> str:
    """Return the ROS name of a DDS type, such as `std_msgs/msg/String`; other types are unchanged."""
    match = _DDS_TYPE.fullmatch(dds_type)
    return dds_type if match is None else f"{match[1]}/msg/{match[2]}"


def split_node_name(name: str) -> tuple[str, str]:
    """Return the namespace and name of a ROS 2 node for a nep node.

    Characters that ROS 2 doesn't allow are replaced by "_".
    """
    *namespaces, node_name = [_INVALID_CHARACTERS.sub("_", part) for part in name.split("/") if part] or ["_"]
    parts = [f"_{part}" if part[:1].isdigit() else part for part in (*namespaces, node_name)]
    return "/" + "/".join(parts[:-1]), parts[-1]


def encode_user_data(entries: Mapping[str, str]) -> bytes:
    """Encode USER_DATA entries as `key=value;`."""
    return "".join(f"{key}={value};" for key, value in entries.items()).encode("ascii")


def decode_user_data(data: bytes) -> dict[str, str]:
    """Decode the entries of USER_DATA; malformed entries are skipped."""
    entries = (entry.partition("=") for entry in data.decode("ascii", "replace").split(";"))
    return {key: value for key, _equals, value in entries if key and value}
