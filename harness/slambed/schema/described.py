# SPDX-License-Identifier: Apache-2.0
"""From a pydantic model to a schema in which each key says what it means."""

from typing import Any

from pydantic import BaseModel
from pydantic.json_schema import GenerateJsonSchema, models_json_schema
from pydantic_core import core_schema

from slambed.schema.field_table import docstrings

DIALECT = "https://json-schema.org/draft/2020-12/schema"
Schema = dict[str, Any]


class Described(GenerateJsonSchema):
    """Takes the docstring below a field as its description, and makes up no titles."""

    def model_schema(self, schema: core_schema.ModelSchema) -> Schema:
        """Of one model, descriptions put in."""
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
        """A key is its own title."""
        return False


def schema_of(model: type[BaseModel]) -> Schema:
    """Of a file that is one `model`."""
    return model.model_json_schema(schema_generator=Described)


def definitions_of(models: list[type[BaseModel]]) -> dict[str, Schema]:
    """Class name -> schema, of these models and of all inside of them."""
    _, found = models_json_schema(
        [(model, "validation") for model in models], schema_generator=Described
    )
    definitions: dict[str, Schema] = found["$defs"]
    return definitions
