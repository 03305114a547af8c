"""Bridges: topics of two back ends, or of two networks of one, joined.

`configuration` has what a bridge is told and `toml_file` reads it, `bridge` joins two of `side`, a `route`
carries one topic one way at the pace of `pacer`. `trail` keeps a message from coming back, `other_bridges`
know who joins the same networks, and `topic_types` as what messages are subscribed and published.
"""

from nep.programs.bridges.bridge import Bridge
from nep.programs.bridges.configuration import (
    BridgeConfiguration,
    BridgeTopic,
    SideConfiguration,
    TopicEnd,
    join_line,
    side_of,
)
from nep.programs.bridges.route import Route, RouteCounts
from nep.programs.bridges.toml_file import read_configuration

__all__ = [
    "Bridge",
    "BridgeConfiguration",
    "BridgeTopic",
    "Route",
    "RouteCounts",
    "SideConfiguration",
    "TopicEnd",
    "join_line",
    "read_configuration",
    "side_of",
]
