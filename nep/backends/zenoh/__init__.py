"""Back end `zenoh`: messages over Eclipse Zenoh, without a master.

`places` parses the places where nodes connect, `rendezvous` connects the nodes of one computer, `keys`
defines the key expressions, `session` is the session of one node, `roster` lists the known nodes, and
`library` loads zenoh.
"""

from nep.backends.base import Backend
from nep.backends.zenoh.places import validate_address
from nep.backends.zenoh.transport import ZenohTransport

BACKEND = Backend(
    "zenoh",
    ZenohTransport,
    needs="eclipse-zenoh",
    master=validate_address,
    has_history=True,
    has_patterns=True,
)
