"""Which of the project's modules imports which, wherever in its file."""

import ast
import functools
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("companion", "sim_vehicle", "rebound_cli", "bench")


@functools.cache
def imported_names(path: Path) -> frozenset[str]:
    """Full names of all that a file imports; of `from a import b` both `a` and `a.b`, which may be a module."""
    names: set[str] = set()
    for node in _statements(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level:
                raise ValueError(f"{path} imports relatively")
            package = node.module or ""
            names.update((package, *(f"{package}.{alias.name}" for alias in node.names)))
    return frozenset(names)


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """All below it, however deep; an expression holds none."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr):
            yield child
            yield from _statements(child)


def module_imports(root: Path) -> dict[str, set[str]]:
    """Every module of the project below ``root``, and those of them that it imports."""
    paths = {_module(path.relative_to(root)): path for name in PACKAGES for path in (root / name).rglob("*.py")}
    return {module: {name for name in imported_names(path) if name in paths} for module, path in paths.items()}


def _module(path: Path) -> str:
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")
