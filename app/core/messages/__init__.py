"""What is in messages: pictures and large JSON, decoded beside the window, only as far as somebody looks."""
