"""Stop: who is told, who must answer, what is proven, and which robots may still move.

What asks a person before a robot moves is in `app.core.robots.motion`.
"""
