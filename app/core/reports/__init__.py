"""Reports of problems: crashes as they are noticed and kept, and the one file that a person may give away."""
