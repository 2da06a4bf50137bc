"""The reference page of the campaign file: `python -m gantryctl.engineering.campaign.report.reference FILE` writes it.

Its prose is `reference.md` beside this file, with places for tables.
"""

from __future__ import annotations

import sys
from pathlib import Path
from string import Template

from gantryctl.engineering.campaign.measures import TESTS
from gantryctl.engineering.campaign.reading import campaigns_folder, load_campaign, shipped_campaigns
from gantryctl.engineering.campaign.tables import LAWS, CampaignFile
from gantryctl.machine.problems import show_value
from gantryctl.machine.specs import FieldSpec, field_specs, table_models
from gantryctl.machine.tables.fields import Table

_HEAD = "| key | default | allowed | meaning |\n|---|---|---|---|"


def reference_page() -> str:
    """The page as Markdown."""
    prose = Template(Path(__file__).with_suffix(".md").read_text(encoding="utf-8"))
    return prose.substitute(
        tables="\n".join(_table(path, model) for path, model in table_models(CampaignFile).items()),
        laws="\n".join(_law(name, model) for name, model in LAWS.items()),
        outputs="\n".join(
            f"| `{test}` | `{name}` | {output.unit} | {output.meaning} |"
            for test, each in TESTS.items()
            for name, output in each.outputs.items()
        ),
        shipped="\n".join(_shipped(name) for name in shipped_campaigns()),
    )


def _table(path: str, model: type[Table]) -> str:
    specs = [spec for spec in field_specs(CampaignFile).values() if spec.table == path]
    meaning = (model.__doc__ or "").strip().partition(": ")[2]
    return "\n".join(
        [f"## `[{path}]`\n", f"{meaning[:1].upper()}{meaning[1:]}\n", _HEAD, *map(_row, specs), ""]
    )


def _law(name: str, model: type[Table]) -> str:
    specs = [_spec(key, model) for key in model.model_fields]
    rows = [_row(spec) for spec in specs if spec.key != "law"]
    return "\n".join(
        [f'### `law = "{name}"`\n', f"{specs[0].meaning}\n", *([_HEAD, *rows, ""] if rows else [])]
    )


def _spec(key: str, model: type[Table]) -> FieldSpec:
    # A law is a whole table; specs are made for files, so it is looked at as a file of one table.
    from pydantic import create_model

    whole = create_model("Whole", __base__=Table, vary=(model, ...))
    return field_specs(whole)[f"vary.{key}"]


def _row(spec: FieldSpec) -> str:
    default = "**required**" if spec.default is None else f"`{show_value(spec.default, None)}`"
    return f"| `{spec.key}` | {default} | {spec.allowed} | {spec.meaning} |"


def _shipped(name: str) -> str:
    campaign = load_campaign(campaigns_folder() / f"{name}.toml")
    return f"| `{name}` | {campaign.settings.campaign.description} | {campaign.design.rows} |"


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(reference_page(), encoding="utf-8")
