"""Nodes, publishers and subscribers: the API that `nep.node` opens.

Payloads are encoded and decoded here; a back end transports the bytes.
"""
