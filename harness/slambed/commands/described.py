# SPDX-License-Identifier: Apache-2.0
"""What every command says of itself, as Markdown: what --help prints, for docs/."""

import inspect
from collections.abc import Iterator
from typing import Any

from slambed.commands.main import every_command
from slambed.schema.markdown import markdown_table, prose

HEADINGS = ["argument or option", "type", "default", "meaning"]


def verbs() -> str:
    """A table of all commands with a line each, and a section for every one."""
    found = list(_commands(every_command(), "slambed"))
    rows = [
        [f"[`{name}`](#{_anchor(name)})", prose(_paragraphs(command)[0])] for name, command in found
    ]
    parts = [markdown_table(["command", "what it does"], rows)]
    parts += [_section(name, command) for name, command in found]
    return "\n".join(parts)


def _commands(group: Any, name: str) -> Iterator[tuple[str, Any]]:
    for word, command in group.commands.items():
        if command.hidden:
            continue
        yield f"{name} {word}", command
        if hasattr(command, "commands"):
            yield from _commands(command, f"{name} {word}")


def _anchor(name: str) -> str:
    return name.replace(" ", "-")


def _paragraphs(command: Any) -> list[str]:
    text = inspect.cleandoc(command.help or "")
    return [" ".join(paragraph.split()) for paragraph in text.split("\n\n")]


def _section(name: str, command: Any) -> str:
    context = command.context_class(command, info_name=name)
    usage = " ".join([name, *command.collect_usage_pieces(context)])
    rows = [
        [
            _names(item),
            _type(item, context),
            _default(item),
            prose(" ".join((item.help or "").split())),
        ]
        for item in command.get_params(context)
        if item.name != "help" and not item.hidden
    ]
    text = "\n\n".join(prose(paragraph) for paragraph in _paragraphs(command))
    table = f"\n{markdown_table(HEADINGS, rows)}" if rows else ""
    return f"### {name}\n\n{text}\n\n```text\n{usage}\n```\n{table}"


def _names(item: Any) -> str:
    if item.param_type_name == "argument":
        return f"`{item.name}`"
    return ", ".join(f"`{name}`" for name in (*item.opts, *item.secondary_opts))


def _type(item: Any, context: Any) -> str:
    kind = str(item.display_type(context)).strip("<>")
    if kind == "bool":
        return "flag"
    if "|" in kind:
        return " or ".join(f"`{choice}`" for choice in kind.strip("[]").split("|"))
    bounds = [
        f"{sign} {bound:g}"
        for sign, bound in (("≥", item.min), ("≤", item.max))
        if bound is not None
    ]
    inner = kind.removeprefix("list[").removesuffix("]").removesuffix(" range").lower()
    words = " ".join([inner, ", ".join(bounds)]).strip()
    return f"{words}, repeatable" if kind.startswith("list[") else words


def _default(item: Any) -> str:
    if item.required:
        return "required"
    if item.secondary_opts:
        return f"`{(item.opts if item.default else item.secondary_opts)[0]}`"
    if item.default is None or item.default is False or item.default == "":
        return ""
    return f"`{item.default}`"
