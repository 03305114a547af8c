"""Kinds of networks that Studio can show in addition to the native one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from nep.backends.base import find_backend
from nep.i18n import _, lazy
from nep.messages.codecs import content_of
from nep.protocol.graph_view import TopicInfo

_ROS_2_IMAGE_TYPE = "sensor_msgs/msg/CompressedImage"
_ROS_STRING_TYPE = "std_msgs/String"


@dataclass(frozen=True, slots=True)
class NetworkKind:
    """Supported kind of network.

    Attributes:
        name: Name of nep's back end.
        product_name: Product name.
        address_label: Label of the address field (a `lazy` text).
        default_address: Default address.
        hint: Advice for the user (a `lazy` text).
        reports_stats: True if the nodes report rates, losses and CPU use.
        codec_of: Returns the codec of a topic, if the codec in the graph is too general.
        readable_type_of: Returns the message type for a subscription.
        qos: Quality of service that is compatible with most publishers.
    """

    name: str
    product_name: str
    address_label: str
    default_address: str
    hint: str
    reports_stats: bool
    codec_of: Callable[[TopicInfo], str]
    readable_type_of: Callable[[TopicInfo], str]
    qos: str = ""

    def validate_address(self, address: str) -> str:
        """Validate an address and return it in the form that the back end expects.

        A blank address becomes `default_address`. Raises `NepError` if the address is invalid.
        """
        return find_backend(self.name).master(address.strip() or self.default_address)

    @property
    def unknown_text(self) -> str:
        """Text in place of a value that this kind of network doesn't report, such as "unknown on ROS 2"."""
        return _("unknown on {network}").format(network=self.product_name)


def _ros_2_codec(info: TopicInfo) -> str:
    return "image" if info.msg_type == _ROS_2_IMAGE_TYPE else info.codec


def _ros_2_readable_type(info: TopicInfo) -> str:
    return "image" if info.msg_type == _ROS_2_IMAGE_TYPE else info.msg_type


def _ros_readable_type(info: TopicInfo) -> str:
    # A json subscriber reads any message as a map, also of a package that is not installed here.
    if content_of(info.codec) == "image":
        return "image"
    return _ROS_STRING_TYPE if info.msg_type == _ROS_STRING_TYPE else "json"


KINDS = (
    NetworkKind(
        "ros",
        "ROS 1",
        lazy("Address of the ROS master"),
        "127.0.0.1:11311",
        lazy(
            "The ROS master may be on another computer; this computer then accepts connections from that "
            "network."
        ),
        reports_stats=False,
        codec_of=lambda info: info.codec,
        readable_type_of=_ros_readable_type,
    ),
    NetworkKind(
        "ros2",
        "ROS 2",
        lazy("Domain, 0 to 232"),
        "0",
        lazy(
            "Shows programs on this computer, and on other computers only if ROS_AUTOMATIC_DISCOVERY_RANGE "
            "allows it."
        ),
        reports_stats=False,
        codec_of=_ros_2_codec,
        readable_type_of=_ros_2_readable_type,
        qos="best_effort",  # a best-effort reader is compatible with best-effort and reliable writers
    ),
    NetworkKind(
        "zenoh",
        "Zenoh",
        lazy("Address of a node or router"),
        "local",
        lazy("“local” is this computer; the address of a router looks like tcp/192.168.1.5:7447."),
        reports_stats=True,
        codec_of=lambda info: info.codec,
        readable_type_of=lambda info: info.msg_type,
    ),
)
_KINDS_BY_NAME = {kind.name: kind for kind in KINDS}


def find_kind(name: str) -> NetworkKind | None:
    """Return the kind with this name; None for "" (the native network) and unknown names."""
    return _KINDS_BY_NAME.get(name)
