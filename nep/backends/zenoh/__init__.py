"""Back end `zenoh`: messages over Eclipse Zenoh, without a master.

Modules:

- `places`: network addresses, and sessions opened at them
- `rendezvous`: connections between the nodes of one computer
- `keys`: key expressions
- `session`: session of one node
- `roster`: known nodes
- `library`: loading of zenoh
"""

from nep.backends.base import Backend
from nep.backends.zenoh.addresses import validate_address
from nep.backends.zenoh.transport import ZenohTransport

BACKEND = Backend(
    "zenoh",
    ZenohTransport,
    needs="eclipse-zenoh",
    master=validate_address,
    has_history=True,
    has_patterns=True,
)
