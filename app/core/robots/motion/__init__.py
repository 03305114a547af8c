"""Motion of real robots: the question to the user, the gate before messages, commands of bridges.

The proof that robots have stopped is in `app.core.robots.stop`.
"""
