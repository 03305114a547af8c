"""Back ends: implementations of the transport between nodes. Each module defines one `BACKEND`.

`base` defines the interface, `memory` is the reference implementation to copy from, and `zeromq` is the
default.
"""
