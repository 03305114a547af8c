"""Bridges: forwarding of topics between two back ends, or between two networks of one back end.

`configuration` defines a bridge and `toml_file` parses it. `bridge` connects two instances of `side`. A
`route` forwards one topic in one direction, at a rate limited by `pacer`. `trail` prevents loops,
`other_bridges` detects bridges between the same networks, and `topic_types` chooses message types.
"""

from nep.programs.bridges.bridge import Bridge
from nep.programs.bridges.configuration import (
    BridgeConfiguration,
    BridgeTopic,
    SideConfiguration,
    TopicEnd,
    configuration_from_arguments,
    side_configuration,
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
    "configuration_from_arguments",
    "read_configuration",
    "side_configuration",
]
