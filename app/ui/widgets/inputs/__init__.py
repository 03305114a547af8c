"""Input widgets: fields, segments, combo box, slider and switch.

Used by the forms of robots, by settings and by filters.
"""
