"""Server side of Foxglove's WebSocket protocol, for Foxglove and Lichtblick."""

from nep.programs.web.foxglove.page import ChannelFormat, FoxglovePage
from nep.programs.web.foxglove.protocol import SUBPROTOCOLS, is_offered

__all__ = ["SUBPROTOCOLS", "ChannelFormat", "FoxglovePage", "is_offered"]
