"""What the window shows and does, without the window: session, mailbox, runner. No Qt."""
