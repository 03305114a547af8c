"""Input widgets: fields, token fields, JSON editor, segments, combo box, check box, slider and switch.

Used by the forms of robots, by settings and by filters.
"""
