"""The table of commands with their keys, and the keys as a person changed them."""
