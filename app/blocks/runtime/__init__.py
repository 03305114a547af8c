"""Execution of a program in a separate process: scripts, robots, topics, and values.

`child` is the main module of the process and opens the program's node, `scheduler` decides which script runs,
and `network` publishes, subscribes and sends commands to robots.
"""
