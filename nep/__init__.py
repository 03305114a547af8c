"""NEP: messages between robots, programs and people."""
