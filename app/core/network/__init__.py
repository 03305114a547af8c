"""What is on the network, as the window shows it: messages come in by threads and leave by the mailbox.

Topics, nodes, watches and their figures; the master and who may reach it.
"""
