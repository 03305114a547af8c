"""Back ends: what carries bytes between nodes. Each module binds one `BACKEND`.

`base` is the contract, `memory` the template, `zeromq` the one that programs use.
"""
