"""Master: registry of nodes, publishers and subscribers. Messages never pass through it.

The server thread, the graph with its leases, and functions to find and start a master.
"""
