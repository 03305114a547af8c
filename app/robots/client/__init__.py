"""Client of robots: commands, replies judged by their sender, Stop and its proof, and discovery of robots.

Its parts do no I/O: they take messages, graphs and times as arguments. Only `discovery` and `heartbeat` wait.
"""
