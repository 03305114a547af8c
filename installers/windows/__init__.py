"""The packages for Windows: the setup program and the portable zip, on Windows or through Wine."""
