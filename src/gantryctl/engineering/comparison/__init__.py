"""Two ways of control on one plant: the same runs, the same figures, over one gear or over many."""

from gantryctl.engineering.comparison.ensemble import Ensemble, ensemble, random_plant
from gantryctl.engineering.comparison.figures import FIGURES, Figures, figures_of
from gantryctl.engineering.comparison.profiles import ProfileRow, profiles_at_equal_base_motion
from gantryctl.engineering.comparison.report import CompareReport, compare_report
from gantryctl.engineering.comparison.variants import (
    Variant,
    check_same_plant,
    variants,
    without_load_encoder,
)

__all__ = [
    "FIGURES",
    "CompareReport",
    "Ensemble",
    "Figures",
    "ProfileRow",
    "Variant",
    "check_same_plant",
    "compare_report",
    "ensemble",
    "figures_of",
    "profiles_at_equal_base_motion",
    "random_plant",
    "variants",
    "without_load_encoder",
]
