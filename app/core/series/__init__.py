"""Series: numbers and states picked from topics by field paths, kept, and reduced for drawing.

`feed` is what the session has; all else needs numpy and is loaded by whoever opens the first plot.
"""
