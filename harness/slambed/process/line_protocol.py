# SPDX-License-Identifier: Apache-2.0
"""The protocol between processes of a run: each message is a line of JSON with a model.

The requesting side uses a `LineProcess`, the answering side a `LineReader`. Malformed and unknown
messages raise one error, only here.
"""

import contextlib
import os
import select
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import IO, Any, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, TypeAdapter, ValidationError

from slambed.errors import ExitCode, PassingError, SlambedError, environment_error

STOP_TIMEOUT_S = 10.0
LAST_WORDS_S = 1.0
CHUNK_BYTES = 65536


M = TypeVar("M")
A = TypeVar("A", bound="Message")


class Message(BaseModel):
    """Base class of messages; one of several kinds has a tag field, `request` or `reply`."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Failure(Message):
    """Answer of a process that could not execute a request."""

    reply: Literal["failure"] = "failure"
    error: str
    """One line: what failed, where, and what to do."""
    code: int
    """Exit code of that process."""
    passes: bool = False
    """Whether another try may succeed."""

    @staticmethod
    def of(error: SlambedError) -> "Failure":
        """Converts an error; a temporary failure stays temporary."""
        passes = isinstance(error, PassingError)
        return Failure(error=str(error), code=int(error.code), passes=passes)

    def exception(self) -> SlambedError:
        """Converts it back to the error of the other side."""
        kind = PassingError if self.passes else SlambedError
        return kind(self.error, ExitCode(self.code))


class Note(Message):
    """Progress message for the user while the answer is being computed."""

    reply: Literal["note"] = "note"
    line: str


class Start(Message):
    """Sets run time 0: the link's profile and the samples begin."""

    request: Literal["start"] = "start"
    t0_ns: int
    """CLOCK_MONOTONIC at run time 0."""


class Started(Message):
    """Answer."""

    reply: Literal["started"] = "started"


@cache
def adapter(kind: Any) -> TypeAdapter[Any]:
    """Returns the parser for a message type or a union of them."""
    return TypeAdapter(kind)


def line_of(message: Message) -> bytes:
    """Returns the serialized message."""
    return message.model_dump_json().encode() + b"\n"


def message_in(line: bytes, known: TypeAdapter[M], speaker: str) -> M:
    """Parses a line. Raises SlambedError with the code of an internal error if it is no known
    message."""
    try:
        return known.validate_json(line)
    except ValidationError as error:
        what = error.errors()[0]["msg"]
        shown = line.strip().decode(errors="replace")[:200]
        raise SlambedError(
            f"the {speaker} said {shown!r}, which is no known message ({what}); "
            "are both of one version?",
            ExitCode.INTERNAL,
        ) from None


def send(stream: IO[str], message: Message) -> None:
    """Writes and flushes the message."""
    stream.write(line_of(message).decode())
    stream.flush()


def bug(error: Exception) -> Failure:
    """Returns the answer for an error that is no known failure."""
    line = f"a bug of slambed: {type(error).__name__}: {error}"
    return Failure(error=line, code=int(ExitCode.INTERNAL))


@contextlib.contextmanager
def last_answer(
    answer: Callable[[Message], None], describe: Callable[[Exception], Failure] = bug
) -> Iterator[None]:
    """Runs the work of a process that answers requests. The end of the input ends the work. An
    error becomes the last answer, so that the process at the other end can report it."""
    try:
        yield
    except EOFError:
        return
    except SlambedError as error:
        answer(Failure.of(error))
    except Exception as error:
        answer(describe(error))


class LineReader:
    """Reads whole lines from a descriptor, even if they arrive in pieces."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._buffer = b""

    def next(self, timeout_s: float | None) -> bytes | None:
        """Returns the next line; None after the timeout (`timeout_s` None: no timeout). Raises
        EOFError at the end of the input."""
        deadline = None if timeout_s is None else time.monotonic() + timeout_s
        while b"\n" not in self._buffer:
            left = None if deadline is None else max(0.0, deadline - time.monotonic())
            if not select.select([self._fd], [], [], left)[0]:
                return None
            chunk = os.read(self._fd, CHUNK_BYTES)
            if not chunk:
                raise EOFError
            self._buffer += chunk
        line, _, self._buffer = self._buffer.partition(b"\n")
        return line


class LineProcess:
    """A child process that answers one request at a time. It exits when its input closes, even
    if we are killed."""

    def __init__(self, command: list[str], name: str, errors: Path) -> None:
        self._name = name
        self._errors = errors
        with errors.open("wb") as log:
            try:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=log,
                    # Ctrl-C reaches only the harness, which stops its children in its own order.
                    start_new_session=True,
                )
            except FileNotFoundError:
                raise environment_error(
                    f"{command[0]} is not on this host, and the {name} needs it; install it"
                ) from None
        assert self._process.stdout is not None
        self._answers = LineReader(self._process.stdout.fileno())

    def ask(
        self,
        request: Message,
        kind: type[A],
        timeout_s: float,
        note: Callable[[str], None] = lambda line: None,
    ) -> A:
        """Returns the answer, of type `kind`; `note` receives progress messages before it.
        Raises PassingError on a timeout, SlambedError when the answer is a failure."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line_of(request))
            self._process.stdin.flush()
        except OSError:
            # A failure that it wrote before it ended says more than its end.
            while isinstance(self._hear(kind, LAST_WORDS_S), Note):
                pass
            raise self._ended("ended") from None
        while isinstance(answer := self._hear(kind, timeout_s), Note):
            note(answer.line)
        return answer

    def _hear(self, kind: type[A], timeout_s: float) -> A | Note:
        try:
            line = self._answers.next(timeout_s)
        except EOFError:
            raise self._ended("ended") from None
        if line is None:
            raise self._ended(f"did not answer within {timeout_s:.0f} s")
        answer: A | Note | Failure = message_in(line, adapter(kind | Note | Failure), self._name)
        if isinstance(answer, Failure):
            raise answer.exception()
        return answer

    def alive(self) -> bool:
        """Returns False once the process has ended."""
        return self._process.poll() is None

    def close(self, patience_s: float = STOP_TIMEOUT_S) -> None:
        """Closes its input and kills it after a timeout; safe to call twice."""
        if self._process.stdin is not None:
            with contextlib.suppress(OSError):
                self._process.stdin.close()
        try:
            self._process.wait(patience_s)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _ended(self, what: str) -> PassingError:
        lines = self._errors.read_text(errors="replace").strip().splitlines()
        message = f": {lines[-1].removeprefix('error: ')}" if lines else ""
        return PassingError(f"the {self._name} {what}{message}")
