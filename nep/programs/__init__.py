"""What is made of nodes, and runs as a command, too: bridges and blackboards."""
