# SPDX-License-Identifier: Apache-2.0
"""Makes a JSON schema from a pydantic model, with a description for each key."""

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, models_json_schema
from pydantic_core import core_schema

from slambed.schema.field_table import docstrings

DIALECT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]


class Described(GenerateJsonSchema):
    """Uses the docstring below a field as its description, and adds no titles."""

    def model_schema(self, schema: core_schema.ModelSchema) -> Schema:
        """Returns the schema of one model with descriptions."""
        found = super().model_schema(schema)
        model: type = schema["cls"]
        bases = [
            b for b in reversed(model.__mro__) if b is not BaseModel and issubclass(b, BaseModel)
        ]
        meanings = {name: text for base in bases for name, text in docstrings(base).items()}
        for name, text in meanings.items():
            if (field := found.get("properties", {}).get(name)) is not None:
                field.setdefault("description", text)
        return found

    def field_title_should_be_set(self, schema: Any) -> bool:
        """Returns False, because a key is its own title."""
        return False


def schema_of(model: type[BaseModel]) -> Schema:
    """Returns the schema of a file that holds one `model`."""
    return model.model_json_schema(schema_generator=Described)


def definitions_of(models: list[type[BaseModel]]) -> dict[str, Schema]:
    """Maps the class name to the schema, for these models and all nested ones."""
    _, found = models_json_schema(
        [(model, "validation") for model in models], schema_generator=Described
    )
    definitions: dict[str, Schema] = found["$defs"]
    return definitions
