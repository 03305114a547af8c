"""Services of the back end zeromq: a node's servers and clients, which meet through a master or directly."""
