"""Nodes, publishers and subscribers: the API behind `nep.node`.

Payloads are encoded and decoded here; a back end transports the bytes.
"""
