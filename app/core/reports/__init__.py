"""Problem reports: stored crash reports, and the zip file that the user can share."""
