"""WebSocket server for web pages and tablets, with the rosbridge v2 protocol (docs/web.md).

On request it also serves Foxglove's protocol. The package contains both protocols, the server, and the
conversion of NEP's messages to ROS shapes. `nep.programs.robots` contains the motion guard;
`nep.backends.ros` parses ROS message definitions and encodes ROS messages.
"""

from nep.programs.web.access import Access
from nep.programs.web.context import ConnectedPage, PageTopic, Rejection
from nep.programs.web.server import WebServer, WebSettings

__all__ = ["Access", "ConnectedPage", "PageTopic", "Rejection", "WebServer", "WebSettings"]
