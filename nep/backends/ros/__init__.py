"""Back end `ros`: ROS 1 over rospy. nep nodes and ROS nodes use the same ROS master.

See docs/ros.md. Modules:

- `library`: loading of rospy
- `process`: the single ROS node of this process
- `address`, `master`: address of the ROS master, and client for it
- `definition`, `type_mapping`, `service_types`: conversion of ROS messages and services
- `transport`, `subscriber`, `queue_room`, `graph`: implementation of `nep.backends.base`
- `service_client`, `service_connection`, `service_server`: services
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
