"""What is kept on the disk between starts: settings and files, written so that a crash leaves no half."""
