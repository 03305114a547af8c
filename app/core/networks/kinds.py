"""Kinds of networks that Studio can show in addition to its own: names, addresses, available statistics."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from nep.backends.base import backend_named
from nep.i18n import _, lazy
from nep.protocol.graph_view import TopicInfo

_PICTURES_OF_ROS_2 = "sensor_msgs/msg/CompressedImage"
_TEXT_OF_ROS = "std_msgs/String"


@dataclass(frozen=True, slots=True)
class NetworkKind:
    """Supported kind of network.

    Attributes:
        name: Name of nep's back end.
        words: Product name.
        place: Label of the address field (a `lazy` text).
        example: Default address.
        hint: Advice for the user (a `lazy` text).
        tells_figures: True if the nodes report rates, losses and CPU use.
        codec: Returns the codec of a topic, where that of the graph is too general.
        reads: Returns the message type to subscribe with.
        qos: Quality of service that is compatible with most publishers.
    """

    name: str
    words: str
    place: str
    example: str
    hint: str
    tells_figures: bool
    codec: Callable[[TopicInfo], str]
    reads: Callable[[TopicInfo], str]
    qos: str = ""

    def checked(self, address: str) -> str:
        """Return the address in the form of the back end. Raises `NepError` if the address is invalid."""
        return backend_named(self.name).master(address.strip() or self.example)

    @property
    def not_known(self) -> str:
        """Explanation of a missing value, such as "unknown on ROS 2"."""
        return _("unknown on {network}").format(network=self.words)


def _codec_of_ros_2(info: TopicInfo) -> str:
    return "image" if info.msg_type == _PICTURES_OF_ROS_2 else info.codec


def _reads_ros_2(info: TopicInfo) -> str:
    return "image" if info.msg_type == _PICTURES_OF_ROS_2 else info.msg_type


def _reads_ros(info: TopicInfo) -> str:
    # A json subscriber reads any message as a map, also of a package that is not installed here.
    if info.codec == "image":
        return "image"
    return _TEXT_OF_ROS if info.msg_type == _TEXT_OF_ROS else "json"


KINDS = (
    NetworkKind(
        "ros",
        "ROS 1",
        lazy("Address of the master"),
        "127.0.0.1:11311",
        lazy("A master on another computer. This computer then accepts connections from that network, too."),
        tells_figures=False,
        codec=lambda info: info.codec,
        reads=_reads_ros,
    ),
    NetworkKind(
        "ros2",
        "ROS 2",
        lazy("Domain, 0 to 232"),
        "0",
        lazy("Programs on this computer; others only if ROS_AUTOMATIC_DISCOVERY_RANGE allows it."),
        tells_figures=False,
        codec=_codec_of_ros_2,
        reads=_reads_ros_2,
        qos="best_effort",  # a best-effort reader is compatible with best-effort and reliable writers
    ),
    NetworkKind(
        "zenoh",
        "Zenoh",
        lazy("Address of a node or router"),
        "local",
        lazy("“local” is this computer; the address of a router looks like tcp/192.168.1.5:7447."),
        tells_figures=True,
        codec=lambda info: info.codec,
        reads=lambda info: info.msg_type,
    ),
)
_BY_NAME = {kind.name: kind for kind in KINDS}


def kind_named(name: str) -> NetworkKind | None:
    """Return the kind with this name; None for "" (the native network) and unknown names."""
    return _BY_NAME.get(name)
