"""Back end `ros`: ROS 1 over rospy. nep nodes and ROS nodes use the same ROS master.

See docs/ros.md. Modules:

- `library`: loading of rospy
- `process`: the single ROS node of this process
- `master`: client for the ROS master
- `definition`, `type_mapping`: conversion of ROS messages
- `transport`: implementation of `nep.backends.base`
"""

from __future__ import annotations

from nep.backends.base import Backend, Transport
from nep.backends.ros.address import ros_master_address
from nep.backends.ros.type_mapping import codec_of
from nep.protocol.requests import NodeRecord


def _open(node: NodeRecord) -> Transport:
    from nep.backends.ros.transport import RospyTransport  # noqa: PLC0415 - XML-RPC is slow to import and only for ROS

    return RospyTransport(node)


BACKEND = Backend(
    "ros",
    _open,
    needs="python3-rospy",
    aliases=("ros1",),
    codec_for=codec_of,
    master=ros_master_address,
    has_extensions=False,
)
