"""File format of recordings: records, chunks, channels, indexes, limits and damage.

Reading, playing, repairing and exporting messages are in the parent package.
"""
