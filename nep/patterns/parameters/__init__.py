"""Parameters: values of a node that others may read and set while it runs."""
