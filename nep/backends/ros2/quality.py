"""Quality of service in one word, and what it is in DDS.

| word          | reliability | what is kept for readers that are behind    |
|---------------|-------------|---------------------------------------------|
| "" "reliable" | RELIABLE    | nep's own depth: see `depth_of`             |
| "best_effort" | BEST_EFFORT | the same                                    |
| "sensor"      | BEST_EFFORT | 5 messages, as ROS 2's profile sensor data  |

Durability is VOLATILE, TRANSIENT_LOCAL for what is latched. Depth is nobody's business but one's own: it
plays no part in who is matched with whom.
"""

from __future__ import annotations

from typing import Any

from nep.backends.ros2.library import Dds
from nep.backends.ros2.participant import policy
from nep.backends.ros2.type_mapping import CDR

__all__ = ["QUALITIES", "depth_of", "qualities"]

QUALITIES = ("reliable", "best_effort", "sensor")
_SENSOR_DEPTH = 5
_BLOCKING_NS = 100_000_000
"""So long a message waits for room before it is lost to those that are behind: DDS's own default."""
_DEPTHS = {"image": 16, "bytes": 200, CDR: 200}
_DEPTH = 8192
"""ROS 2's own 10 would lose bursts of small messages."""
_NO_LIMIT = -1


def depth_of(quality: str, codec: str) -> int:
    """How many messages are kept."""
    return _SENSOR_DEPTH if quality == "sensor" else _DEPTHS.get(codec, _DEPTH)


def qualities(
    library: Dds, quality: str, depth: int, *, is_latched: bool, told: bytes, history: int = 1
) -> tuple[Any, ...]:
    """The policies of a writer or reader. `history`: what a writer keeps for those that come late."""
    policies = policy(library)
    is_reliable = quality in ("", "reliable")
    found = [
        policies.Reliability.Reliable(_BLOCKING_NS) if is_reliable else policies.Reliability.BestEffort,
        policies.Durability.TransientLocal if is_latched else policies.Durability.Volatile,
        policies.History.KeepLast(max(depth, history)),
        policies.DataRepresentation(use_cdrv0_representation=True),
        policies.Userdata(told),
    ]
    if is_latched:
        last = policies.History.KeepLast(max(1, history))
        found.append(policies.DurabilityService(0, last, _NO_LIMIT, _NO_LIMIT, _NO_LIMIT))
    return tuple(found)
