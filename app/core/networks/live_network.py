"""Live network: the part of `app.core.session.Session` that holds its state."""

from __future__ import annotations

from dataclasses import dataclass

from app.core.messages.image_streams import Images
from app.core.network.nodes import Nodes
from app.core.network.topics import Topics
from app.core.networks.networks import Networks
from app.core.series.feed import SeriesFeed
from nep.protocol.graph_view import GraphView


@dataclass(slots=True)
class LiveNetwork:
    """State of the live network, which is updated even while a recording is shown.

    Used by robots, Stop, alarms and health.
    """

    topics: Topics
    nodes: Nodes
    networks: Networks
    images: Images
    series: SeriesFeed
    graph: GraphView | None
