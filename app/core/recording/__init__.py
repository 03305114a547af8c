"""Recordings as Studio makes and lists them: the recorder's process, and the files in a folder."""
