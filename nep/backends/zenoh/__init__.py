"""Back end `zenoh`: messages over Eclipse Zenoh, without a master.

Modules:

- `library`: loading of zenoh
- `addresses`: network addresses, and sessions opened at them
- `rendezvous`: connections between the nodes of one computer
- `keys`: key expressions
- `session`, `roster`: session of one node, and the nodes that it knows
- `publisher`, `subscriber`, `early_messages`, `inboxes`: messages
- `services`, `node_services`: services
- `transport`: implementation of `nep.backends.base`
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
