"""Master: registry of nodes, publishers and subscribers. Messages never pass through it.

This package contains the server thread, the graph with its leases, and functions that find and start a
master.
"""
