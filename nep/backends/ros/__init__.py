"""The back end `ros`: ROS 1 through rospy. Nodes of nep meet nodes of ROS at the ROS master.

`library` finds rospy, `process` has the one ROS node of a process, `master` asks the ROS master, `definition`
and `carried` make bytes of ROS messages, `transport` joins them. See docs/ros.md.
"""

from __future__ import annotations

from nep.backends.base import Backend, Transport
from nep.backends.ros.address import address_of
from nep.backends.ros.carried import codec_of
from nep.protocol.requests import NodeRecord

__all__ = ["BACKEND"]


def _open(node: NodeRecord) -> Transport:
    from nep.backends.ros.transport import RospyTransport  # noqa: PLC0415 - XML-RPC is heavy, and for ROS only

    return RospyTransport(node)


BACKEND = Backend(
    "ros",
    _open,
    needs="python3-rospy",
    aliases=("ros1",),
    codec_for=codec_of,
    master=address_of,
    has_extensions=False,
)
