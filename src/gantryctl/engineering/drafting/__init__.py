"""Drafts: from a few answers to a requirement sheet, and from a sheet and a motor to a whole machine file.

Every value has its origin beside it: the sheet, the catalogue, a computation, a choice of this product, or a guess. A
guess is a statement about the world that nobody has measured or decided; it is listed, marked in the file, and named in
`[machine] guesses`. Nothing is taken from the reference machine.

`origin` what an origin is, `basis` quantities that several rules need, `motion`, `loops`, `plant`, `gear_errors` the
rules, `draft` the whole; `questions`, `templates` and `sheets` lead from answers to a sheet, `writing` to files.
"""
