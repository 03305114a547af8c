"""What may move real robots: the question to a person, the gate before messages, commands of bridges.

Proof that robots stand still is in `app.core.robots.stop`.
"""
