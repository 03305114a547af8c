"""Series: numbers and states over time, read from messages, stored, and downsampled for drawing.

`feed` is part of the session. All other modules need numpy and are loaded with the first plot.
"""
