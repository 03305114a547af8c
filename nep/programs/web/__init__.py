"""Web pages and tablets: a WebSocket server that speaks the rosbridge v2 protocol (docs/web.md).

Here: the protocol, the server, and NEP's messages in the shapes of ROS. Robots' own safety is in
`nep.programs.robots`, ROS message definitions are parsed and packed by `nep.backends.ros`.
"""

from nep.programs.web.access import Access
from nep.programs.web.context import ConnectedPage, PageTopic, Refusal
from nep.programs.web.server import WebServer, WebSettings

__all__ = ["Access", "ConnectedPage", "PageTopic", "Refusal", "WebServer", "WebSettings"]
