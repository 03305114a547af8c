"""Live network of the window: threads receive messages and pass them to the window through the mailbox.

The package contains topics, nodes, watches and their statistics, the master and remote access to it, the
web server, and the connection doctor.
"""
