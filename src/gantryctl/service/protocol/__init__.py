"""What travels between service and clients: messages, tags, roles."""
