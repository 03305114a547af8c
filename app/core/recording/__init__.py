"""Recordings: the recorder's process, and the list of files in a folder."""
