"""Recordings: client of the recorder process, replay, and the files in a folder."""
