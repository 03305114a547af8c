"""Widgets that hold a value: segments, choice, slider."""
