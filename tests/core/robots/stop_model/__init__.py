"""Simulated lab for tests of Stop.

It has virtual time, an unreliable network, robots, a hostile program and Studio's session.
"""
