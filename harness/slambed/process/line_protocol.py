# SPDX-License-Identifier: Apache-2.0
"""The one way in which processes of a run talk: a message is a line of JSON, and has a model.

Who asks holds a `LineProcess`; who answers reads with a `LineReader`. What is no whole message of a
kind that is understood is one error, raised here and nowhere else.
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

from slambed.errors import ExitCode, PassingError, SlambedError

STOP_TIMEOUT_S = 10.0
CHUNK_BYTES = 65536


M = TypeVar("M")
A = TypeVar("A", bound="Message")


class Message(BaseModel):
    """What a line says; a kind that is one of several has a field of its own, `request` or
    `reply`."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Failure(Message):
    """The answer of a process that could not do what it was asked."""

    reply: Literal["failure"] = "failure"
    error: str
    """One line: what, where, what to do."""
    code: int
    """As the process would exit with it."""
    passes: bool = False
    """Worth another try."""

    @staticmethod
    def of(error: SlambedError) -> "Failure":
        """A failure that passes stays one."""
        passes = isinstance(error, PassingError)
        return Failure(error=str(error), code=int(error.code), passes=passes)

    def exception(self) -> SlambedError:
        """What it was on the other side."""
        kind = PassingError if self.passes else SlambedError
        return kind(self.error, ExitCode(self.code))


class Note(Message):
    """What a process says for a person while its answer takes its time."""

    reply: Literal["note"] = "note"
    line: str


class Start(Message):
    """Run time 0: the link's profile and the samples begin."""

    request: Literal["start"] = "start"
    t0_ns: int
    """On CLOCK_MONOTONIC."""


class Started(Message):
    """The answer."""

    reply: Literal["started"] = "started"


@cache
def adapter(kind: Any) -> TypeAdapter[Any]:
    """What reads messages of a kind, or of one of several."""
    return TypeAdapter(kind)


def line_of(message: Message) -> bytes:
    """A message as it travels."""
    return message.model_dump_json().encode() + b"\n"


def message_in(line: bytes, known: TypeAdapter[M], speaker: str) -> M:
    """The message of a line; SlambedError (a bug of ours) where it is none that is known."""
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
    """Says it at once."""
    stream.write(line_of(message).decode())
    stream.flush()


def bug(error: Exception) -> Failure:
    """The answer where an error is not a known failure."""
    line = f"a bug of slambed: {type(error).__name__}: {error}"
    return Failure(error=line, code=int(ExitCode.INTERNAL))


@contextlib.contextmanager
def last_answer(
    answer: Callable[[Message], None], describe: Callable[[Exception], Failure] = bug
) -> Iterator[None]:
    """Around the work of a process that answers: the end of its input ends the work, and an error
    becomes the last answer, so that the process that asked can report it."""
    try:
        yield
    except EOFError:
        return
    except SlambedError as error:
        answer(Failure.of(error))
    except Exception as error:
        answer(describe(error))


class LineReader:
    """Whole lines from a descriptor, however they are cut into pieces on their way."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._buffer = b""

    def next(self, timeout_s: float | None) -> bytes | None:
        """The next line; None when there is none in time (None: it waits for ever). Raises EOFError
        at the end of the input."""
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
    """A child that answers one request at a time; it ends with its input, however we die."""

    def __init__(self, command: list[str], name: str, errors: Path) -> None:
        self._name = name
        self._errors = errors
        with errors.open("wb") as log:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=log,
                # Ctrl-C reaches the harness alone; it ends its children in its own order.
                start_new_session=True,
            )
        assert self._process.stdout is not None
        self._answers = LineReader(self._process.stdout.fileno())

    def ask(
        self,
        request: Message,
        kind: type[A],
        timeout_s: float,
        note: Callable[[str], None] = lambda line: None,
    ) -> A:
        """The answer, of this kind; `note` hears what is said before it. PassingError when there is
        none in time, SlambedError when it is a failure."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(line_of(request))
            self._process.stdin.flush()
        except OSError:
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
        """False once it has ended."""
        return self._process.poll() is None

    def close(self, patience_s: float = STOP_TIMEOUT_S) -> None:
        """Ends it, or kills it when it does not end in this time; calling it twice is harmless."""
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
