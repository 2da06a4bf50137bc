"""Protocol between service and clients: messages, tags, roles, limits."""
