"""Back end `ros2`: nep nodes as ROS 2 nodes, over Cyclone DDS and rosbags. Needs no ROS installation.

Modules:

- `environment`, `library`: settings from environment variables, loading of the libraries
- `names`, `message_types`, `fields`, `type_mapping`, `topics`: conversion of names and values
- `participant`, `matches`: this process in a DDS domain, and its matches with other programs
- `quality`, `mismatches`: QoS profiles, and alerts for types and QoS that differ
- `publisher`, `subscriber`, `services`, `graph`, `transport`: implementation of `nep.backends.base`
"""

from nep.backends.base import Backend
from nep.backends.ros2.environment import resolve_domain
from nep.backends.ros2.message_types import MessageTypes, message_types
from nep.backends.ros2.quality import QOS_PROFILES
from nep.backends.ros2.services.definitions import call_codec_for
from nep.backends.ros2.transport import Ros2Transport
from nep.backends.ros2.type_mapping import codec_for

__all__ = ["BACKEND", "MessageTypes", "message_types"]

BACKEND = Backend(
    "ros2",
    Ros2Transport,
    needs="cyclonedds, rosbags",
    master=resolve_domain,
    codec_for=codec_for,
    call_codec_for=call_codec_for,
    qos=QOS_PROFILES,
    has_history=True,
    has_extensions=False,
)
