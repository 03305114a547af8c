"""Foxglove's WebSocket protocol: connections of Foxglove and Lichtblick."""

from nep.programs.web.foxglove.page import ChannelFormat, FoxglovePage
from nep.programs.web.foxglove.protocol import SUBPROTOCOLS

__all__ = ["SUBPROTOCOLS", "ChannelFormat", "FoxglovePage"]
