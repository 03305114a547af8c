"""Panels to watch messages, nodes, alarms and the state of the network."""
