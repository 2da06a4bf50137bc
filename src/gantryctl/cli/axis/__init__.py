"""Commands that move the axis or tell where it stands, on this computer or through the service."""
