"""docs/file-keys.md, from the models that check files: run `python -m docs.tools.file_keys`."""

import sys
from dataclasses import fields
from typing import Any

from pydantic import BaseModel

from docs.tools.schema_words import default_words, one_line, type_words
from fidim_lab.app.formats.key_words import key_words, range_words, sentence
from fidim_lab.app.formats.run_spec import number_type, number_words, numbers
from fidim_lab.data.campaign import CampaignTable
from fidim_lab.data.importers.mapped_csv import ColumnMap
from fidim_lab.data.importers.robot_log import LogMap
from fidim_lab.data.plan_file import PlanTable
from fidim_lab.data.rigs.rig_tables import RigTable
from fidim_lab.data.robot_file import RobotTable
from fidim_lab.identification.results.result_file import ResultTable
from procedures.settings import ReleaseSettings, Settings

INTRODUCTION = """# Keys of files

Made from the models that check the files, by `python -m docs.tools.file_keys`; a test compares them. SI
units throughout. A key without a default must be there; an unknown key is an error. What the tables of a rig file mean:
[rig.md](rig.md); what a run's folder holds: [files.md](files.md). `fidim init KIND`
writes a new file with all of this in it.
"""
FILES: tuple[tuple[str, type[BaseModel], str], ...] = (
    ("Robot file, `fidim-robot/1` (TOML)", RobotTable, "robot"),
    ("Rig file, `fidim-rig/1` (TOML)", RigTable, "rig"),
    ("Plan, `fidim-plan/1` (TOML)", PlanTable, "plan"),
    ("Campaign, `fidim-campaign/1` (TOML)", CampaignTable, "campaign"),
    ("Columns of a table to import, `fidim-columns/1` (TOML)", ColumnMap, ""),
    ("Columns of a robot log, `fidim-log/1` (TOML)", LogMap, ""),
    ("Result, `fidim-result/1` (JSON)", ResultTable, ""),
)
"""heading, model, and the kind of file in `key_words`"""
SETTINGS = """## Settings of a procedure (`fidim run --set TABLE.KEY=NUMBER`)

SI units. What the rig file says comes before these defaults, and `--set` before both: guards go as far as a rig file
may set them, speeds and accelerations as far as its winches may. What each means: `procedures/settings.py`.
"""


def file_keys_page() -> str:
    """The whole page: each file, then the tables inside it."""
    parts = [INTRODUCTION]
    for heading, model, kind in FILES:
        schema = model.model_json_schema()
        parts += [f"## {heading}\n", *_table(schema, kind, model.__name__)]
        for name, inner in schema.get("$defs", {}).items():
            if "properties" in inner:
                parts += [f"### {_title(name, inner)}\n", *_table(inner, kind, name)]
    return "\n".join([*parts, SETTINGS, *_settings()])


def _settings() -> list[str]:
    """A row for each number that can be set."""
    rows: list[str] = []
    settings = Settings(release=ReleaseSettings())
    for field in fields(settings):
        part = getattr(settings, field.name)
        for name, value in numbers(part).items():
            words = number_words(number_type(type(part), name).json_schema())
            rows.append(f"| `{field.name}.{name}` | {words} | `{value:g}` |")
    return ["| setting | allowed | default |", "|---|---|---|", *rows, ""]


def _title(name: str, schema: dict[str, Any]) -> str:
    """The model's docstring says which table it is; its name is what other tables call it."""
    says = one_line(schema.get("description", "")).rstrip(".")
    return f"{name}: {says}" if says else name


def _table(schema: dict[str, Any], kind: str, model: str) -> list[str]:
    """A row for each key; with what it means where the kind of file has words for it."""
    rows = [_row(name, field, schema) for name, field in schema["properties"].items()]
    if not kind:
        return ["| key | value | allowed | default |", "|---|---|---|---|", *rows, ""]
    said = [_meaning(kind, model, name) for name in schema["properties"]]
    told = [f"{row} {meaning} |" for row, meaning in zip(rows, said, strict=True)]
    return ["| key | value | allowed | default | what it is |", "|---|---|---|---|---|", *told, ""]


def _meaning(kind: str, model: str, name: str) -> str:
    words = key_words(kind, model, name)
    return "" if words is None else sentence(words, {}).replace("|", "\\|")


def _row(name: str, field: dict[str, Any], schema: dict[str, Any]) -> str:
    return f"| `{name}` | {type_words(field)} | {range_words(field)} | {default_words(name, field, schema)} |"


if __name__ == "__main__":
    sys.stdout.write(file_keys_page())
