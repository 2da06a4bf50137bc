"""The OPC UA server: tags to read, for the people and clients that it trusts."""
