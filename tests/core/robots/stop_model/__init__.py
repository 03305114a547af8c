"""A simulated computer room for Stop: virtual time, a network that fails, robots, strangers and Studio's session."""
