"""Blocks of the user's own that no code imports: files by their path, and installed packages.

A file declares them with ``@lugrectl.block`` as a notebook cell does. A package names its module
in its pyproject.toml, and each process then has the blocks::

    [project.entry-points."lugrectl.blocks"]
    my_drive = "my_drive.effects"
"""

from __future__ import annotations

import contextlib
import copyreg
import importlib
import sys
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from hashlib import sha256
from pathlib import Path
from types import ModuleType
from typing import Any

from ..core.errors import InputError, NotLoaded
from ..core.pickling import carried, from_fields, rebuilt
from ..core.validation import as_path, like_it
from .block import REGISTRY, Block, registered

GROUP = "lugrectl.blocks"
LOADED: dict[Path, tuple[str, str]] = {}  # file: (name of its module, SHA-256 of its text)
_looked: list[str] = []  # the groups of entry points that were loaded


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


def files_of_blocks(homes: Iterable[str]) -> list[str]:
    """The files among the homes of blocks that were loaded by their path."""
    by_name = {name: str(file) for file, (name, _) in LOADED.items()}
    return [*dict.fromkeys(by_name[home] for home in homes if home in by_name)]


def files_loaded() -> list[str]:
    """The files that were loaded by their path."""
    return [str(file) for file in LOADED]


def place(home: str) -> str:
    """Where another process finds a module: the path of its file where that was loaded by path."""
    return next(iter(files_of_blocks([home])), home)


def fetch(where: str) -> None:
    """Run the module at a place, a name or the path of a file."""
    if where.endswith(".py"):
        load_blocks(where)
    else:
        importlib.import_module(where)


def load_installed() -> None:
    """Load the blocks of installed packages, once; one that fails is a warning by its name."""
    if GROUP in _looked:
        return
    _looked.append(GROUP)  # first: the modules that are loaded ask for the registry
    from importlib.metadata import entry_points  # slow to import

    for entry in entry_points(group=GROUP):
        try:
            with _all_or_none():
                entry.load()
        except Exception as error:
            said = " ".join(f"{type(error).__name__}: {error}".split())
            said = str(error) if isinstance(error, InputError) else said
            owner = getattr(entry.dist, "name", None)
            of = f"the package {owner}" if owner else "an installed package"
            of += f" ({entry.name} = {entry.value})"
            warnings.warn(f"the blocks of {of} are not there: {said}", NotLoaded, stacklevel=2)


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
    registry = registered()
    before = dict(registry)
    try:
        yield
    except BaseException:
        registry.clear()
        registry.update(before)
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


def found(kind: str, name: str, home: str) -> Block | None:
    """A registered block, its module imported where that is needed; None if there is none."""
    if (kind, name) not in REGISTRY and home not in ("__main__", "__mp_main__", ""):
        with contextlib.suppress(ImportError):
            fetch(home)
    return dict(REGISTRY).get((kind, name))


def declared(kind: str, name: str, home: str) -> Block:
    """A registered block, its module imported where that is needed; InputError if there is none."""
    made = found(kind, name, home)
    if made is None:
        where = "the notebook cell or script" if home == "__main__" else f"the module {home}"
        raise InputError(
            f"the {kind} '{name}' is not declared in this session: run {where} that declares it "
            "with @block, then load again."
        )
    return made


def _reduced(made: Block) -> Any:
    """A registered block pickles by kind and name, a composed one by its parts."""
    known = REGISTRY.get((made.kind, made.name))
    if known is made:
        return declared, (made.kind, made.name, place(made.home))
    build = getattr(made.function, "block", None)
    if build is not None and is_dataclass(made.function) and build() == made:
        return rebuilt, (made.function,)
    cure = "" if known is None else "it was declared again since: build what holds it again"
    own = {f.name: getattr(made, f.name) for f in fields(made)}
    for what, value in own.items():
        carried(f"the {what} of the block {made.name}", value, cure)
    return from_fields, (type(made), own)


copyreg.pickle(Block, _reduced)
