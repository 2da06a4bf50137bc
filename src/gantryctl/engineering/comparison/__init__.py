"""Two ways of control on one plant: the same runs, the same figures, over one gear or over many."""
