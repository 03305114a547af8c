"""File format of recordings: records, chunks, channels, indexes, limits and damage.

The parent package reads, plays, repairs and exports messages.
"""
