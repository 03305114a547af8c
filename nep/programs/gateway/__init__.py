"""Gateway: lets programs of the original NEP (all three wire generations) join the native graph.

`gateway` is the thread that runs everything; the formats of the wire generations are in `framing` and
`requests`.
"""
