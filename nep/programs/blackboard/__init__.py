"""Blackboard: the newest values of topics by key, with their ages. Public as `nep.Blackboard`."""
