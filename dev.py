"""Make the environment, then run."""
