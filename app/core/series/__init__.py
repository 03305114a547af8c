"""Series: numbers and states read from topics by field paths, stored, and reduced for drawing.

`feed` is part of the session. All other modules need numpy and are loaded with the first plot.
"""
