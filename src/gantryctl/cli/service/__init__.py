"""Commands that run the service and keep its users and its journal."""
