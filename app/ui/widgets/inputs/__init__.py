"""Input widgets: fields, segments, combo box, slider, switch.

Used by forms of robots, settings and filters.
"""
