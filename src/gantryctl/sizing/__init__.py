"""Drive sizing: the paper's equations (1) to (3) and what they leave out."""
