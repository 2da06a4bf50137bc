"""Tuning: the paper's procedure as a logged sequence on the axis, a method by margins, and the proposal they end in.

`bench` makes the experiments, `procedure` decides by them, `by_margins` needs the linear model only, `judge` looks at
the uncertain plant, `proposal` writes what was found. Nothing here changes a machine file.
"""
