"""Connections of clients to the controller: gateway and local socket alike."""
