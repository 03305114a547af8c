"""Back end `zeromq`: the native wire, and direct connections on the wire of the original NEP."""

from nep.backends.base import Backend
from nep.backends.zeromq.transport import ZeromqTransport

BACKEND = Backend("zeromq", ZeromqTransport, aliases=("zmq",), has_history=True, has_patterns=True)
