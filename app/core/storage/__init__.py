"""What is kept on the disk between starts: settings and files, written so that a crash leaves no half.

Behaviours, journals and versions use it; it knows none of them.
"""
