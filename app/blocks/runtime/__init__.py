"""Execution of a program in its own process: scripts that take turns, robots, topics, values.

`child` is the process, `scheduler` decides which script runs, and only `network` has sockets.
"""
