"""The master: who is there, who publishes, who subscribes. Data never pass through it.

The server's thread, the graph with its leases, and how a master is found and started.
"""
