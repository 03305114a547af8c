"""Gateway that lets programs of the original NEP (all three wire generations) join the native graph.

`gateway` contains the thread of the gateway; `framing` and `requests` contain the formats of the wire
generations.
"""
