# SPDX-License-Identifier: Apache-2.0
"""What is answered to a request."""

import json
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import Any

from slambed.report.page import render
from slambed.serve.guard import PAGE_POLICY

TEMPLATES = "slambed.serve"
FRESH = "no-cache"
"""Kept by the browser, and asked for again each time: mostly nothing has changed."""


@dataclass(frozen=True)
class Answer:
    """Status, headers and content."""

    status: HTTPStatus
    body: bytes
    headers: dict[str, str] = field(default_factory=dict)


def content(body: bytes, kind: str, policy: str = PAGE_POLICY, cache: str = FRESH) -> Answer:
    """Something to be shown."""
    headers = {"Content-Type": kind, "Content-Security-Policy": policy, "Cache-Control": cache}
    return Answer(HTTPStatus.OK, body, headers)


def page(template: str, status: HTTPStatus = HTTPStatus.OK, **values: object) -> Answer:
    """One of our pages."""
    text = render(template, package=TEMPLATES, **values)
    made = content(text.encode(), "text/html; charset=utf-8")
    return Answer(status, made.body, made.headers)


def as_json(value: Any) -> Answer:
    """What a script of ours asked for; numbers that are none become null."""
    return content(json.dumps(value, allow_nan=False).encode(), "application/json")


def moved(to: str) -> Answer:
    """A page is called with its last slash, because of the links in it."""
    return Answer(HTTPStatus.MOVED_PERMANENTLY, b"", {"Location": to})


def error_page(status: HTTPStatus, line: str) -> Answer:
    """A page that says in a line what is wrong."""
    return page("serve_error.html.j2", status, title=status.phrase, line=line)
