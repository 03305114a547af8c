"""Nodes with their publishers and subscribers: what programs use, made by `nep.node`.

Payloads go in and come out here; a back end carries the bytes.
"""
