"""Back ends: implementations of the transport between nodes.

A module or package in this folder that binds ``BACKEND`` is a back end; `base` defines the interface, and the
other modules contain what several back ends share. `memory` is the reference implementation to copy from;
`zeromq` is the default back end.
"""
