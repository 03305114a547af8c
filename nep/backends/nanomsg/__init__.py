"""The back end `nanomsg`: nodes that carry their messages by the library pynng.

Direct connections speak with programs of libnanomsg; hybrid ones are found through the master. `library`
finds pynng, `direct` has the frames of the original NEP, `publisher` and `sub_socket` the native wire.
"""

from nep.backends.base import Backend
from nep.backends.nanomsg.transport import NanomsgTransport

__all__ = ["BACKEND"]

BACKEND = Backend(
    "nanomsg", NanomsgTransport, needs="pynng", aliases=("nn",), has_history=True, has_patterns=True
)
