"""Back end `nanomsg`: messages over the library pynng.

Direct connections are compatible with libnanomsg; hybrid connections use the master. `library` loads pynng,
`direct` implements the frames of the original NEP, `publisher` and `sub_socket` the native wire.
"""

from nep.backends.base import Backend
from nep.backends.nanomsg.transport import NanomsgTransport

BACKEND = Backend(
    "nanomsg", NanomsgTransport, needs="pynng", aliases=("nn",), has_history=True, has_patterns=True
)
