"""The back end `zenoh`: nodes that carry their messages by Eclipse Zenoh, and need no master.

`places` says where nodes meet, `rendezvous` how those of one computer find each other. `keys` has the key
expressions; a `session` is one node's, with its `roster` of who is there. `library` finds the library.
"""

from nep.backends.base import Backend
from nep.backends.zenoh.places import place_name
from nep.backends.zenoh.transport import ZenohTransport

__all__ = ["BACKEND"]

BACKEND = Backend(
    "zenoh", ZenohTransport, needs="eclipse-zenoh", master=place_name, has_history=True, has_patterns=True
)
