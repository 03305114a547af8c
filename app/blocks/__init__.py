"""Blocks as data, and the compiler that turns a workspace into a Python program."""
