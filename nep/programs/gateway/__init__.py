"""The gateway: programs of the original NEP, all three wire generations, joined to the native graph.

`gateway` is the thread that does it all; what belongs to which wire generation is in `framing` and
`requests`.
"""
