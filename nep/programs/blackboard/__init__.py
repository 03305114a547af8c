"""Blackboard: newest values of topics by key, with their ages. `nep.Blackboard`."""
