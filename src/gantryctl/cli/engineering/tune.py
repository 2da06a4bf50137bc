"""`gantryctl tune`: the paper's procedure, or gains by margins; the result is a proposal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from gantryctl.cli.options import (
    choice_option,
    config_option,
    directory,
    json_option,
    number_option,
    out_option,
    print_json,
    simulated_machine,
    write_json,
)
from gantryctl.cli.text import paragraph, print_table

if TYPE_CHECKING:
    from gantryctl.engineering.tuning.by_margins import Conditions
    from gantryctl.engineering.tuning.procedure import Criteria
    from gantryctl.engineering.tuning.result import Tuning

DEFAULT_OUT = Path("tuning")
# A whole machine file: --config takes it as it is.
PROPOSAL = "proposal.toml"


@click.command()
@config_option
@choice_option(
    "--method",
    ("paper", "margins"),
    "Trials on the simulated axis in the paper's order, or margins over the uncertain plant.",
)
@choice_option(
    "--plant", ("machine", "paper-drive"), "The axis of the machine file, or as the paper's drive saw it."
)
@number_option(
    ("--base-limit", "base_um"),
    150.0,
    "Base motion at which raising the acceleration stops, um p-p (method paper).",
)
@number_option(("--sensitivity",), 1.7, "Largest sensitivity peak (method margins).")
@number_option(
    ("--damping-left",),
    0.8,
    "Part of its own damping that the loop leaves the load at least (method margins).",
)
@click.option("--log", "with_log", is_flag=True, help="Print every trial.")
@click.option("--plot", is_flag=True, help="Write pictures to --out.")
@out_option
@json_option
def tune(
    config_file: Path | None,
    method: str,
    plant: str,
    base_um: float,
    sensitivity: float,
    damping_left: float,
    with_log: bool,
    plot: bool,
    out: Path | None,
    as_json: bool,
) -> int:
    """Tune the loops on the simulated axis and write the result as a proposal, never over the machine file.

    The proposal is a whole machine file: use it with --config, or look at it with `gantryctl config diff`. It goes to
    --out (default: tuning/) with the log. Exit code 1 when it is unstable somewhere on the uncertain plant.
    """
    from gantryctl.engineering.tuning.data import tuning_data
    from gantryctl.engineering.tuning.proposal import proposed_machine
    from gantryctl.engineering.tuning.result import tune as run

    machine = simulated_machine(config_file, "tune")
    criteria, conditions = _criteria(base_um), _conditions(sensitivity, damping_left)
    result = run(machine, method, as_paper=plant == "paper-drive", criteria=criteria, conditions=conditions)
    # Refused before anything is written.
    proposed_machine(result)
    files = _write(result, directory(out or DEFAULT_OUT), config_file, plot)
    if as_json:
        print_json(tuning_data(result))
    else:
        _show(result, with_log)
        for path in files:
            click.echo(f"wrote {path}")
    return 0 if result.proposal.verdict.stable else 1


def _criteria(base_um: float) -> Criteria:
    from gantryctl.engineering.tuning.procedure import Criteria
    from gantryctl.errors import UsageError

    if base_um <= 0.0:
        raise UsageError(f"--base-limit {base_um:g}: must be above 0 um")
    return Criteria(base_um=base_um)


def _conditions(sensitivity: float, damping_left: float) -> Conditions:
    from gantryctl.engineering.tuning.by_margins import Conditions
    from gantryctl.errors import UsageError

    if not 1.0 < sensitivity <= 10.0:
        raise UsageError(f"--sensitivity {sensitivity:g}: must be above 1 and at most 10")
    if not 0.0 < damping_left <= 10.0:
        raise UsageError(f"--damping-left {damping_left:g}: must be above 0 and at most 10")
    return Conditions(sensitivity=sensitivity, damping_left=damping_left)


def _write(result: Tuning, folder: Path, config_file: Path | None, plot: bool) -> list[Path]:
    from gantryctl.engineering.tuning.data import tuning_data
    from gantryctl.engineering.tuning.figures import tuning_figures
    from gantryctl.engineering.tuning.proposal import write_proposal
    from gantryctl.machine import default_machine_path

    files = write_proposal(result, folder / PROPOSAL, config_file or default_machine_path())
    data = write_json(folder / "tuning.json", tuning_data(result))
    return [*files, data, *(tuning_figures(result, folder) if plot else [])]


def _show(result: Tuning, with_log: bool) -> None:
    from gantryctl.engineering.tuning import text

    # The method by margins has no trials, and no claim to end at the paper's gains.
    if result.tuned is not None:
        if with_log:
            print_table(text.log_table(result.tuned))
        print_table(text.paper_table(result))
    print_table(text.before_after_table(result))
    click.echo()
    for sentence in text.sentences(result):
        paragraph(sentence)
