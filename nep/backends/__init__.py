"""Back ends: implementations of the transport between nodes.

Each module or package in this folder defines one `BACKEND`, except `base`, which defines the interface.
`memory` is the reference implementation to copy from; `zeromq` is the default back end.
"""
