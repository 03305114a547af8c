"""Files of recordings as bytes: records, chunks, channels, indexes, limits and damage.

Reading, playing, repairing and exporting messages is outside.
"""
