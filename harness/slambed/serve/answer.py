# SPDX-License-Identifier: Apache-2.0
"""Answers to requests."""

import json
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

from slambed.report.page import render
from slambed.serve.guard import PAGE_POLICY

TEMPLATES = "slambed.serve"
FRESH = "no-cache"
"""The browser caches the answer but revalidates it each time; mostly nothing has changed."""


@dataclass(frozen=True)
class Answer:
    """Status, headers and body."""

    status: HTTPStatus
    body: bytes
    headers: dict[str, str] = field(default_factory=dict)


def content(body: bytes, kind: str, policy: str = PAGE_POLICY, cache: str = FRESH) -> Answer:
    headers = {"Content-Type": kind, "Content-Security-Policy": policy, "Cache-Control": cache}
    return Answer(HTTPStatus.OK, body, headers)


def page(template: str, status: HTTPStatus = HTTPStatus.OK, **values: object) -> Answer:
    text = render(template, package=TEMPLATES, **values)
    made = content(text.encode(), "text/html; charset=utf-8")
    return Answer(status, made.body, made.headers)


def as_json(value: Any) -> Answer:
    """Returns an answer with JSON for our scripts. Raises ValueError for NaN."""
    return content(json.dumps(value, allow_nan=False).encode(), "application/json")


def moved(to: str) -> Answer:
    """Redirects to the address with a final slash, which relative links need."""
    return Answer(HTTPStatus.MOVED_PERMANENTLY, b"", {"Location": to})


def error_page(status: HTTPStatus, line: str) -> Answer:
    return page("serve_error.html.j2", status, title=status.phrase, line=line)
