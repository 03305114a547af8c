"""Running a behaviour: the program's own process, its pause and end, and what is said of it."""
