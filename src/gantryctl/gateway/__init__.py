"""The gateway process: page, WebSocket and REST for browsers and scripts. It never drives, and may be restarted."""
