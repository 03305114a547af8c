"""The back end `zeromq`: the native wire, and direct connections in the original one.

Its publishers, subscribers and sockets, the thread that serves them, and the session with the master.
"""

from nep.backends.base import Backend
from nep.backends.zeromq.transport import ZeromqTransport

__all__ = ["BACKEND"]

BACKEND = Backend("zeromq", ZeromqTransport, aliases=("zmq",), has_history=True, has_patterns=True)
