"""Parameters: named values of a node that others can read and set at run time."""
