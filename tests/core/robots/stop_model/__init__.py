"""A simulated lab for Stop: virtual time, an unreliable network, robots, strangers and Studio's session."""
