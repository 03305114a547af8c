"""Series: numbers and states selected from topics by field paths, stored, and reduced for drawing.

`feed` belongs to the session; everything else needs numpy and is loaded with the first plot.
"""
