"""Imports point one way: the packages lie in layers, and none imports from a layer above its own."""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import hovercontrol

ROOT = Path(hovercontrol.__file__).parent

#: From bottom to top. Those of one layer may import each other, but not in a circle.
LAYERS = (
    {"errors", "io", "endings"},
    {"core"},
    {"display"},
    {"simulation", "targets"},
    {"effects"},
    {"models", "controllers", "estimators", "guidance", "hardware", "logs"},
    {"estimation"},
    {"autopilot", "scenarios"},
    {"discrepancy", "identify", "monitor", "analysis", "fmi", "samples", "animation"},
    {"log_check", "schema", "missing_physics"},
    {"cockpit", "commands", "documents"},
    {"cli"},
)
#: A Block's methods import its backends, which are above it, inside functions.
BLOCK = "core.block_backends"
HEIGHT = {package: height for height, layer in enumerate(LAYERS) for package in layer}


@cache
def modules():
    """Each module's syntax tree by name, read once."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        if parts[0] not in ("__init__", "__main__", "analyses"):  # users of what lies below
            found[name] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def type_only(tree):
    """What is imported for the sake of annotations alone is not imported when the program runs."""
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING"):
            for statement in node.body:
                yield from ast.walk(statement)


def inside_functions(tree):
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            yield from ast.walk(node)


def imports(tree, known, *, functions=True, annotations=False):
    skipped = set() if annotations else set(type_only(tree))
    skipped |= set() if functions else set(inside_functions(tree))
    for node in ast.walk(tree):
        if node in skipped:
            continue
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "imports are absolute"
            source = node.module.split(".")
            if source[0] == "hovercontrol":
                for alias in node.names:
                    whole = ".".join([*source[1:], alias.name])
                    yield whole if whole in known else ".".join(source[1:])
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name.startswith("hovercontrol."):
                    yield alias.name.partition(".")[2]


@cache
def arrows():
    """Every import of one module by another, inside functions too but for those of a Block's methods."""
    trees = modules()
    return {
        (name, other)
        for name, tree in trees.items()
        for other in imports(tree, trees, functions=name != BLOCK)
        if other
    }


def package(module):
    return module.partition(".")[0]


def between_packages():
    return {(a, b) for a, b in arrows() if package(a) != package(b)}


def circle(graph):
    """Return a circle in a graph, or nothing."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_every_package_has_its_layer():
    assert {package(name) for name in modules()} <= set(HEIGHT)


def test_no_module_imports_from_a_layer_above_its_own():
    against = {(a, b) for a, b in between_packages() if HEIGHT[package(b)] > HEIGHT[package(a)]}
    assert sorted(against) == []


def test_no_module_names_a_type_of_a_layer_above_its_own():
    trees = modules()
    arrows = {(a, b) for a, tree in trees.items() for b in imports(tree, trees, annotations=True) if b}
    against = {(a, b) for a, b in arrows if HEIGHT.get(package(b), 0) > HEIGHT[package(a)]}
    assert {a for a, _ in against} <= {BLOCK}  # a Block's methods return what a backend makes


def test_packages_import_each_other_in_no_circle():
    graph = defaultdict(set)
    for a, b in between_packages():
        graph[package(a)].add(package(b))
    assert circle(graph) == []


def test_modules_import_each_other_in_no_circle():
    graph = defaultdict(set)
    for a, b in arrows():
        graph[a].add(b)
    assert circle(graph) == []
