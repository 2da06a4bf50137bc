"""Tuning: the paper's procedure as a logged sequence on the axis, a method by margins, and the proposal they end in.

`bench` makes the experiments, `procedure` decides by them, `by_margins` needs the linear model only, `judge` takes
the uncertain plant, `proposal` writes the result. Nothing here changes a machine file.
"""
