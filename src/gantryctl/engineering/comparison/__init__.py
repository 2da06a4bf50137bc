"""Two ways of control on one plant: the same runs, the same figures, over one gear or over many."""

from gantryctl.engineering.comparison.ensemble import PlantEnsemble, ensemble, random_plant
from gantryctl.engineering.comparison.key_figures import KEY_FIGURES, KeyFigures, measure_key_figures
from gantryctl.engineering.comparison.profiles import ProfileRow, profiles_at_equal_base_motion
from gantryctl.engineering.comparison.report import CompareReport, compare_report
from gantryctl.engineering.comparison.variants import (
    Variant,
    check_same_plant,
    variants,
    without_load_encoder,
)

__all__ = [
    "KEY_FIGURES",
    "CompareReport",
    "KeyFigures",
    "PlantEnsemble",
    "ProfileRow",
    "Variant",
    "check_same_plant",
    "compare_report",
    "ensemble",
    "measure_key_figures",
    "profiles_at_equal_base_motion",
    "random_plant",
    "variants",
    "without_load_encoder",
]
