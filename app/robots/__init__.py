"""Robots: descriptions, and the driver kit that creates a driver from functions.

Drivers import `app.robots.kit`. Studio's own robots are one module each: `simulated` (Pepper), `turtle`
(two-wheeled robot), `rize` (robots that only use RIZE's dialect).
"""
