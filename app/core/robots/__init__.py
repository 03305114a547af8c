"""Robots: who is there, what a person tries with them, whether they may move, their stop."""
