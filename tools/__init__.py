"""Development tools: checks, benchmarks, images, environments. Not part of the installed packages."""
