"""The controller process: the scan with its publisher, alarms and retained memory."""
