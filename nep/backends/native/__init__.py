"""The native wire over ZeroMQ: the node's thread, its link to the master, its sockets."""
