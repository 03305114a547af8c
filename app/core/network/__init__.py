"""Live network of the window: threads receive messages and pass them on through the mailbox.

Contains topics, nodes, watches and their statistics, the master, and remote access to it.
"""
