"""Execution of a program in a separate process: scripts that take turns, robots, topics, values.

`child` is the main module of the process, `scheduler` decides which script runs, and only `network` uses
sockets.
"""
