"""A program while it runs, in a process of its own: scripts that take turns, robots, topics, values.

`child` is the process, `scheduler` decides whose turn it is, and only `network` has sockets.
"""
