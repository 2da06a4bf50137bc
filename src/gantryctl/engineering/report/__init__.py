"""Ground that every report stands on: text tables, the look of figures, plain data, the frame of an HTML page."""
