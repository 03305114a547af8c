"""What a problem's button does to the blocks: pure functions from one workspace to the next."""
