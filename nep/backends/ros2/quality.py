"""QoS profiles of nep and their DDS policies.

| name          | reliability | queue depth                                 |
|---------------|-------------|---------------------------------------------|
| "" "reliable" | RELIABLE    | see `queue_depth`                           |
| "best_effort" | BEST_EFFORT | see `queue_depth`                           |
| "sensor"      | BEST_EFFORT | 5 messages, as ROS 2's sensor data profile  |

Durability is TRANSIENT_LOCAL for latched topics, otherwise VOLATILE. The queue depth applies only
locally; endpoints with different depths match.
"""

from __future__ import annotations

from typing import Any

from nep.backends.ros2.library import Dds
from nep.backends.ros2.participant import policy_classes
from nep.messages.codecs import Codec

QOS_PROFILES = ("reliable", "best_effort", "sensor")
_SENSOR_DEPTH = 5
_MAX_BLOCKING_NS = 100_000_000
"""Maximum time in nanoseconds that a message waits for room in a queue before it is dropped.

This is the default of DDS.
"""
_LARGE_MESSAGE_DIVISOR = 4
"""Divisor of the queue length for codecs of large messages, because DDS queues them at both ends."""
_DEFAULT_DEPTH = 8192
"""Default queue depth in messages. The default of ROS 2 is 10, which would lose bursts of messages."""
_UNLIMITED = -1


def queue_depth(profile: str, codec: Codec) -> int:
    """Return the queue depth in messages for a QoS profile and a codec."""
    if profile == "sensor":
        return _SENSOR_DEPTH
    return codec.queue_length // _LARGE_MESSAGE_DIVISOR if codec.queue_length else _DEFAULT_DEPTH


def qos_policies(
    library: Dds, profile: str, depth: int, *, is_latched: bool, user_data: bytes, history: int = 1
) -> tuple[Any, ...]:
    """Return the QoS policies of a writer or reader.

    Args:
        library: Modules of cyclonedds.
        profile: Name of the QoS profile.
        depth: Queue depth in messages.
        is_latched: True to store messages for late readers, or to receive stored messages.
        user_data: USER_DATA of the endpoint.
        history: Number of messages stored for late readers.
    """
    policies = policy_classes(library)
    is_reliable = profile in ("", "reliable")
    result = [
        policies.Reliability.Reliable(_MAX_BLOCKING_NS) if is_reliable else policies.Reliability.BestEffort,
        policies.Durability.TransientLocal if is_latched else policies.Durability.Volatile,
        policies.History.KeepLast(max(depth, history)),
        policies.DataRepresentation(use_cdrv0_representation=True),
        policies.Userdata(user_data),
    ]
    if is_latched:
        history_policy = policies.History.KeepLast(max(1, history))
        result.append(policies.DurabilityService(0, history_policy, _UNLIMITED, _UNLIMITED, _UNLIMITED))
    return tuple(result)
