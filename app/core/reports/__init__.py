"""Problem reports: detected crashes, missing packages, and the zip file that the user can share."""
