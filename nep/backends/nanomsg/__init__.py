"""Back end `nanomsg`: messages over the library pynng.

Direct connections are compatible with libnanomsg; hybrid connections use the master. The frames of the
original NEP are in `direct`, the native wire in `publisher` and `sub_socket`.
"""

from nep.backends.base import Backend
from nep.backends.nanomsg.transport import NanomsgTransport

BACKEND = Backend(
    "nanomsg", NanomsgTransport, needs="pynng", aliases=("nn",), has_history=True, has_patterns=True
)
