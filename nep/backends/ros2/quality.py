"""QoS profiles of nep and their DDS policies.

| name          | reliability | queue depth                                 |
|---------------|-------------|---------------------------------------------|
| "" "reliable" | RELIABLE    | see `depth_of`                              |
| "best_effort" | BEST_EFFORT | see `depth_of`                              |
| "sensor"      | BEST_EFFORT | 5 messages, as ROS 2's sensor data profile  |

Durability is TRANSIENT_LOCAL for latched topics, otherwise VOLATILE. The depth is local: it doesn't affect
matching.
"""

from __future__ import annotations

from typing import Any

from nep.backends.ros2.library import Dds
from nep.backends.ros2.participant import policy_classes
from nep.backends.ros2.type_mapping import CDR

QOS_PROFILES = ("reliable", "best_effort", "sensor")
_SENSOR_DEPTH = 5
_MAX_BLOCKING_NS = 100_000_000
"""Maximum time in nanoseconds that a message waits for room in a queue before it is lost; DDS's default."""
_DEPTH_BY_CODEC = {"image": 16, "bytes": 200, CDR: 200}
_DEFAULT_DEPTH = 8192
"""Default queue depth in messages. The default of ROS 2, 10, would lose bursts of small messages."""
_UNLIMITED = -1


def queue_depth(quality: str, codec: str) -> int:
    """Return the queue depth in messages."""
    return _SENSOR_DEPTH if quality == "sensor" else _DEPTH_BY_CODEC.get(codec, _DEFAULT_DEPTH)


def qos_policies(
    library: Dds, quality: str, depth: int, *, is_latched: bool, announced: bytes, history: int = 1
) -> tuple[Any, ...]:
    """Return the QoS policies of a writer or reader. `history` messages are kept for late readers."""
    policies = policy_classes(library)
    is_reliable = quality in ("", "reliable")
    found = [
        policies.Reliability.Reliable(_MAX_BLOCKING_NS) if is_reliable else policies.Reliability.BestEffort,
        policies.Durability.TransientLocal if is_latched else policies.Durability.Volatile,
        policies.History.KeepLast(max(depth, history)),
        policies.DataRepresentation(use_cdrv0_representation=True),
        policies.Userdata(announced),
    ]
    if is_latched:
        last = policies.History.KeepLast(max(1, history))
        found.append(policies.DurabilityService(0, last, _UNLIMITED, _UNLIMITED, _UNLIMITED))
    return tuple(found)
