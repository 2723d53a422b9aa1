"""Blocks of the user's own in a file, which declares them with ``@lugrectl.block``."""

from __future__ import annotations

import contextlib
import copyreg
import importlib
import sys
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from ..core.errors import InputError
from ..core.pickling import carried, from_fields, rebuilt
from ..core.validation import as_path, like_it
from .block import REGISTRY, Block, registered

LOADED: dict[Path, tuple[str, str]] = {}  # file: (name of its module, SHA-256 of its text)


def load_blocks(path: str | Path) -> list[str]:
    """Declare the blocks of a Python file: effects, friction laws, observers, controllers.

    The file is run like a script in its own folder. A file that was loaded before is run again
    only if its text has changed, and then replaces its blocks.

    Parameters
    ----------
    path : str or Path
        A file with one or more ``@lugrectl.block``.

    Returns
    -------
    list of str
        The names of the blocks that it declares.

    Raises
    ------
    InputError
        When the file is missing, fails or declares nothing; the sentence names file and line. No
        block of it is declared then.

    Examples
    --------
    >>> from pathlib import Path
    >>> file = Path("mine.py")
    >>> lines = [
    ...     "import lugrectl as lg",
    ...     "@lg.block('effect', out='d', acts='torque')",
    ...     "def stiff(theta, k=lg.P(0.0, 'N m/rad3', neutral=0.0)):",
    ...     "    return k * theta**3",
    ... ]
    >>> size = file.write_text(chr(10).join(lines))
    >>> lg.load_blocks(file)
    ['stiff']
    """
    file, text = _read(path)
    stem = "".join(c if c.isalnum() else "_" for c in file.stem)
    # a name that no other file has; without a dot, so that what it holds pickles
    name = f"blocks_{stem}_{sha256(str(file).encode('utf-8', 'replace')).hexdigest()[:8]}"
    digest = sha256(text).hexdigest()
    if LOADED.get(file) != (name, digest):
        with _all_or_none():
            _run(file, text, name)
            if not _declared_by(name):
                raise InputError(
                    f"{file} declares no block: write @lugrectl.block above each function."
                )
        LOADED[file] = name, digest
    return _declared_by(name)


def load_named(given: Any, folder: str | Path, where: str) -> tuple[str, ...]:
    """The files that ``blocks`` of a model names, loaded; InputError starts with ``where``."""
    given = [given] if isinstance(given, str) else given
    if not isinstance(given, (list, tuple)) or not all(isinstance(one, str) for one in given):
        raise InputError(f'{where}: blocks must be a list of files, such as ["mine.py"].')
    files = [Path(folder, one) for one in given]
    for file in files:
        try:
            load_blocks(file)
        except InputError as error:
            raise InputError(f"{where}: blocks: {error}") from error
    return tuple(str(file.resolve()) for file in files)


def files_of_blocks(homes: Iterable[str] | None = None) -> list[str]:
    """The files that were loaded by their path: all, or those among the homes of blocks."""
    by_name = {name: str(file) for file, (name, _) in LOADED.items()}
    return [*dict.fromkeys(by_name[home] for home in homes or by_name if home in by_name)]


def _read(path: str | Path) -> tuple[Path, bytes]:
    path = as_path(path, "a file of blocks")
    try:
        return path.resolve(), path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such file of blocks{like_it(path)}.") from None
    except IsADirectoryError:
        raise InputError(f"{path} is a folder: name a file of blocks, such as mine.py.") from None
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror or error}).") from None


def _run(file: Path, text: bytes, name: str) -> None:
    module = ModuleType(name)
    module.__file__ = str(file)
    before = sys.modules.get(name)
    sys.modules[name] = module  # as for an import: dataclasses and pickles look there
    folder = str(file.parent)
    sys.path.insert(0, folder)  # modules beside the file can be imported, as from a script
    try:
        exec(compile(text, str(file), "exec", dont_inherit=True), module.__dict__)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # SystemExit of a script as well
        if before is None:
            del sys.modules[name]
        else:
            sys.modules[name] = before
        raise InputError(_sentence(file, error)) from error
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(folder)


@contextlib.contextmanager
def _all_or_none() -> Iterator[None]:
    """A file that fails leaves no block behind."""
    before = dict(registered())
    try:
        yield
    except BaseException:
        REGISTRY.clear()
        REGISTRY.update(before)
        raise


def _sentence(file: Path, error: BaseException) -> str:
    """File, line and what went wrong there."""
    line, what, frame = None, " ".join(f"{error}".split()), error.__traceback__
    while frame is not None:
        line = frame.tb_lineno if frame.tb_frame.f_code.co_filename == str(file) else line
        frame = frame.tb_next
    if isinstance(error, SyntaxError) and error.filename == str(file):
        line = error.lineno
    where = f"{file}, line {line}" if line else str(file)
    if isinstance(error, InputError):
        return f"{where}: {what}"
    if isinstance(error, SyntaxError):
        return f"{where}: {type(error).__name__}: {error.msg}."
    return f"{where}: {type(error).__name__}: {what or 'no message'}."


def _declared_by(name: str) -> list[str]:
    return [made.name for made in registered().values() if made.home == name]


def declared(kind: str, name: str, where: str) -> Block:
    """A registered block; ``where`` its module is to be found, a name or the path of a file."""
    if (kind, name) not in registered() and where not in ("__main__", "__mp_main__", ""):
        with contextlib.suppress(ImportError):
            if where.endswith(".py"):
                load_blocks(where)
            else:
                importlib.import_module(where)
    if (kind, name) not in REGISTRY:
        home = "the notebook cell or script" if where == "__main__" else f"the module {where}"
        raise InputError(
            f"the {kind} '{name}' is not declared in this session: run {home} that declares it "
            "with @block, then load again; for worker processes, use jobs=1."
        )
    return REGISTRY[kind, name]


def _reduced(made: Block) -> Any:
    """A registered block pickles by kind and name, a composed one by its parts."""
    known = REGISTRY.get((made.kind, made.name))
    if known is made:
        where = next(iter(files_of_blocks([made.home])), made.home)
        return declared, (made.kind, made.name, where)
    build = getattr(made.function, "block", None)
    if build is not None and is_dataclass(made.function) and build() == made:
        return rebuilt, (made.function,)
    cure = "" if known is None else "it was declared again since: build what holds it again"
    own = {f.name: getattr(made, f.name) for f in fields(made)}
    for what, value in own.items():
        carried(f"the {what} of the block {made.name}", value, cure)
    return from_fields, (type(made), own)


copyreg.pickle(Block, _reduced)
