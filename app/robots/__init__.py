"""Robots: their descriptions, and the kit that makes a driver from functions.

Drivers import `app.robots.kit`. The robots of Studio are one module each: `simulated` is Pepper, `turtle` the
robot on two wheels, `rize` what speaks only RIZE's dialect.
"""
