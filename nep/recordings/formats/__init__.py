"""File format of recordings: records, chunks, channels, indexes, limits and damage.

The parent package uses these modules to read, play, repair and export recordings.
"""
