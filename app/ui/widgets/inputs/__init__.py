"""Widgets that hold a value: fields, segments, choice, slider, switch.

Robots' forms, settings and filters use them; what they mean is their user's.
"""
