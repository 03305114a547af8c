"""NEP Studio, the desktop program."""
