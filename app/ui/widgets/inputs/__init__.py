"""Widgets that hold a value: fields, segments, choice, slider, switch."""
