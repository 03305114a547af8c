"""Execution of a program in a separate process: scripts, robots, topics, and values.

`child` is the main module of the process, `scheduler` decides which script runs, and only `network` uses
sockets.
"""
