"""Commands that record, play and inspect recordings."""
