"""What must hold for a malformed file: one sentence of ours, or numbers that its text says."""

from __future__ import annotations

import re
import signal
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import lugrectl as lg
from lugrectl.record import read_log

from .files import case

LONGEST = 20  # s
TOKEN = re.compile(r"[+-]?[\d.,'_]*\d[\d.,'_]*(?:[eEdD][+-]?\d+)?")
BLANKS = re.compile(r"(?<=\d)[  ](?=\d{3}\b)")


class TooLong(BaseException):
    """Beyond every ``except Exception`` of a library."""


def wrong_with(number: int, folder: Path) -> tuple[str, list[str], str | None]:
    """The format of a case, what was done to the file, and what is wrong with the answer."""
    path, kind, ways = case(number, folder)
    try:
        with _limited(), warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            wrong = _model(path) if kind == "toml" else _record(path, kind)
        if wrong is None and said:
            wrong = f"warning: {said[0].category.__name__}: {said[0].message}"
    except TooLong:
        wrong = f"longer than {LONGEST} s"
    except BaseException as error:
        wrong = "".join(traceback.format_exception(error)[-2:])
    path.unlink()
    return kind, ways, wrong


@contextmanager
def _limited() -> Iterator[None]:
    def stop(*_: Any) -> None:
        raise TooLong

    if sys.platform == "win32":
        yield
        return
    before = signal.signal(signal.SIGALRM, stop)
    signal.alarm(LONGEST)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def _model(path: Path) -> str | None:
    try:
        model = lg.read_model(path)
    except lg.InputError as error:
        return _sentence(error, str(path))
    again = path.with_suffix(".again.toml")
    lg.write_model(model, again)
    same = lg.read_model(again) == model
    again.unlink()
    return None if same else "written and read again it is another model"


def _record(path: Path, kind: str) -> str | None:
    try:
        log = read_log(path)
    except lg.InputError as error:
        return _sentence(error, path.name)
    if kind == "csv" and (odd := not_in_text(path, log)):
        return odd
    try:
        lg.read_record(path)
        lg.balance(path)
    except lg.InputError as error:
        return _sentence(error, path.name)
    except lg.Refused as error:
        return _sentence(error, "")
    return None


def _sentence(error: Exception, name: str) -> str | None:
    text = str(error)
    if "\n" in text or not text.strip() or len(text) > 1000:
        return f"not a sentence: {text[:300]!r}"
    return None if name in text else f"does not name the file: {text}"


def not_in_text(path: Path, log: Any) -> str | None:
    """A value of a log that its text does not say; times are not compared, they may count on."""
    said = np.array(sorted(_numbers(path)))
    for role, values in log.channels.items():
        x = values[np.isfinite(values)]
        if not len(x):
            continue
        if not len(said):
            return f"{role} has numbers, but the text has none"
        near = said[np.clip(np.searchsorted(said, x), 0, len(said) - 1)]
        below = said[np.clip(np.searchsorted(said, x) - 1, 0, len(said) - 1)]
        off = np.minimum(np.abs(near - x), np.abs(below - x)) > 1e-12 * np.abs(x)
        if off.any():
            return f"{role} = {x[off][0]!r} does not stand in the text ({off.sum()} of {len(x)})"
    return None


def _numbers(path: Path) -> set[float]:
    """Every number that the text may be meant to say, with points or commas as decimal marks."""
    data = path.read_bytes()
    texts = {data.decode(c, "replace") for c in ("utf-8", "latin-1", "utf-16", "utf-16-le")}
    if len(data) % 2:
        texts |= {data.decode("utf-16-be", "replace")}
    found: set[float] = set()
    for text in texts:
        for word in {m for m in TOKEN.findall(text)} | set(re.split(r"[\s,;|\"'`]+", text)):
            found |= _meant(word)
        for word in re.split(r"[\t;|,\n]+", text):
            found |= _meant(BLANKS.sub("", word.strip()))
        for word in re.split(r"[\t;|\n]+", text):
            found |= _meant(word.strip(" \"'`"))
    degrees = {np.deg2rad(x) for x in found} if "deg" in next(iter(texts)) else set()
    turned = {x - 2.0**bits for x in found for bits in (16, 32) if 0 <= x < 2.0**bits}
    return {x for x in found | degrees | turned if np.isfinite(x)}


def _meant(word: str) -> set[float]:
    word = re.sub(r"(?<=[\d.])[dD](?=[+-]?\d)", "e", word)
    ways = {word, word.replace(",", "."), word.replace(",", "")}
    ways |= {word.replace(".", "").replace(",", "."), word.rstrip(",;.")}
    made = set()
    for one in ways:
        try:
            made.add(float(one.replace("_", "x")))
        except ValueError:
            continue
    return made
