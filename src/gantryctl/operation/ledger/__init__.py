"""Ledger of a real machine: for each safety property what gives it, or who has accepted that nothing does.

A row is made from the machine file, the facts of the drive, the proofs of commissioning and the acceptances of persons;
only the acceptances are kept. `gantryctl eds check` and `gantryctl commission` ask the same function, so that they
say the same.
"""

from __future__ import annotations

from gantryctl.operation.ledger.rows import LedgerRow, Proofs, Standing

__all__ = ["LedgerRow", "Proofs", "Standing"]
