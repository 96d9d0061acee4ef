# SPDX-License-Identifier: Apache-2.0
"""Tables of the keys of a YAML file, made from its schema: one for the file, one for each kind of
object in it."""

import json
from typing import Any

from slambed.schema.described import Schema
from slambed.schema.field_table import in_a_row
from slambed.schema.kinds import KINDS
from slambed.schema.markdown import markdown_table, prose

HEADINGS = ["key", "type", "default", "meaning"]
ELSEWHERE = {
    "experiment": {"Profile": "profile"},
    "device-fit": dict.fromkeys(("Fault", "LinkChoice", "Playback", "SystemChoice"), "experiment"),
    "input": {"Playback": "experiment"},
    "inference": {"Playback": "experiment"},
}
"""Kind -> objects whose table is on the page of another kind."""
CURVE = "[curve](profile.md#curves)"
OF_CURVES = ("TraceFile",)
"""Objects in curves, which no key of a profile names."""
MANY = 8
"""So many keys of a curve have a table of their own."""
SAME = {"PartOfParameter": "Parameter"}
"""What a key that another file has half of is described as."""
WORDS = {
    "string": "str", "integer": "int", "number": "float", "boolean": "bool", "null": "null",
    "object": "object", "array": "list",
}  # fmt: skip
BOUNDS = {
    "minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<",
}  # fmt: skip


def key_tables(kind: str) -> str:
    """All tables of a kind, each below the name of its object. Raises ValueError for a key without
    a meaning."""
    schema = KINDS[kind].make()
    page = _Page(schema.get("$defs", {}), ELSEWHERE.get(kind, {}))
    parts = [markdown_table(HEADINGS, rows)] if (rows := page.rows(kind, schema)) else []
    page.waiting += [name for name in OF_CURVES if kind == "profile"]
    for name in page.waiting:
        definition = page.definitions[name]
        sentence = " ".join(definition.get("description", "").split("\n\n")[0].split())
        table = markdown_table(HEADINGS, page.rows(name, definition))
        parts.append(f"### {name}\n\n{prose(sentence)}\n\n{table}")
    return "\n".join(parts)


def curve_table() -> str:
    """The kinds of curves that a profile is made of."""
    definitions = KINDS["profile"].make()["$defs"]
    page = _Page(definitions, {})
    kinds = definitions["Curve"]["anyOf"][1]["properties"]
    rows = []
    for name, item in kinds.items():
        model = definitions.get(item.get("$ref", "").rpartition("/")[2], item)
        keys = [_key(key, value, model) for key, value in model.get("properties", {}).items()]
        meaning = CURVES_WITHOUT_MODEL.get(name) or " ".join(model["description"].split())
        value = ", ".join(keys) if 0 < len(keys) < MANY else page.type_of(item)
        rows.append([f"`{name}`", value, prose(meaning)])
    return markdown_table(["curve", "value, or keys and their defaults", "meaning"], rows)


def _key(name: str, item: Schema, model: Schema) -> str:
    default = _of(item, "default")
    if name in model.get("required", []):
        return f"`{name}`"
    if isinstance(default, float) and default.is_integer():
        default = int(default)
    return f"`{name}: {json.dumps(default)}`".replace('"', "")


CURVES_WITHOUT_MODEL = {
    "constant": "The same value for ever; a plain number means the same.",
    "sum": "Curves added up.",
    "steps": "Pairs [time s, ms]: each value holds from its time until the next one.",
    "points": "Pairs [time s, ms]: straight lines between; the outer values hold outside.",
}
"""Those whose value is no object."""


class _Page:
    """What one page has of a kind: `waiting` are the objects that still need a table."""

    def __init__(self, definitions: dict[str, Schema], elsewhere: dict[str, str]) -> None:
        self.definitions = definitions
        self.elsewhere = elsewhere
        self.waiting: list[str] = []

    def rows(self, name: str, schema: Schema) -> list[list[str]]:
        """A row for each key."""
        required, made = schema.get("required", []), "title" in schema
        found = []
        for key, item in schema.get("properties", {}).items():
            meaning = _of(item, "description")
            if not meaning:
                raise ValueError(f"{name}.{key} has no meaning: write a docstring below it")
            default = "required" if key in required else self.default(item, made)
            meaning = prose(in_a_row(meaning.replace("\\|", "|")))
            found.append([f"`{key}`", self.type_of(item), default, meaning])
        return found

    def default(self, item: Schema, made: bool) -> str:
        """As YAML has it; empty where a key that is not given means nothing. `made`: pydantic made
        the schema, which leaves out what is empty."""
        if (value := _of(item, "default")) is None:
            empty = {"array": "`[]`", "object": "`{}`"} if made else {}
            return empty.get(str(item.get("type")), "")
        if isinstance(value, float) and value.is_integer():
            value = int(value)
        return "" if value == "" else f"`{json.dumps(value)}`".replace('"', "")

    def type_of(self, item: Schema) -> str:
        """In words."""
        if name := item.get("$ref", "").rpartition("/")[2]:
            return self._named(name)
        if members := item.get("anyOf") or item.get("oneOf"):
            words = [self.type_of(member) for member in members if not _is_parameter(member)]
            return " or ".join(dict.fromkeys(words))
        if "const" in item:
            return f"`{item['const']}`"
        if "enum" in item:
            return " or ".join(f"`{value}`" for value in item["enum"])
        kind = item.get("type")
        if isinstance(kind, list):
            return " or ".join(WORDS[word] for word in kind)
        if kind == "array":
            return self._list(item)
        if kind == "object" and isinstance(inner := item.get("additionalProperties"), dict):
            return f"object of {_grouped(self.type_of(inner))}"
        bounds = [f"{sign} {_number(item[key])}" for key, sign in BOUNDS.items() if key in item]
        return " ".join([WORDS.get(str(kind), "any"), ", ".join(bounds)]).strip()

    def _list(self, item: Schema) -> str:
        if isinstance(parts := item.get("prefixItems"), list):
            return f"[{', '.join(self.type_of(part) for part in parts)}]"
        return f"list of {_grouped(self.type_of(item['items']))}" if item.get("items") else "list"

    def _named(self, name: str) -> str:
        name = SAME.get(name, name)
        if page := self.elsewhere.get(name):
            anchor = "" if name.lower() == page else f"#{name.lower()}"
            return f"[{name}]({page}.md{anchor})"
        if name == "Curve":
            return CURVE
        if "properties" not in (schema := self.definitions[name]):
            return self.type_of(schema)
        if name not in self.waiting:
            self.waiting.append(name)
        return f"[{name}](#{name.lower()})"


def _grouped(words: str) -> str:
    return f"({words})" if " or " in words else words


def _number(value: float) -> str:
    return str(int(value)) if float(value).is_integer() else f"{value:g}"


def _is_parameter(item: Schema) -> bool:
    """`$name`, which stands for a number of a profile's `params`."""
    return str(item.get("pattern", "")).startswith(r"^\$")


def _of(item: Schema, key: str) -> Any:
    """Of a key, or of the number in it for which a parameter may stand."""
    if key in item:
        return item[key]
    return next((member[key] for member in item.get("anyOf", []) if key in member), None)
