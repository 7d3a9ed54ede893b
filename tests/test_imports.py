"""The package has nine rooms in one line, and imports point down it."""

import ast
from collections import defaultdict
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import hovercontrol

ROOT = Path(hovercontrol.__file__).parent

#: From bottom to top.
ROOMS = ("base", "blocks", "logs", "craft", "control", "fmi", "identification", "documents", "app")
HEIGHT = {room: height for height, room in enumerate(ROOMS)}
#: A Block finds its backends, which are above it, when it is asked for one.
BLOCK = "blocks.block_backends"


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


def statements(node, inside=False, typed=False):
    """Yield each import, whether it is inside a function, and whether it serves annotations alone."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, inside, typed
        elif isinstance(child, ast.stmt):
            of_types = isinstance(child, ast.If) and ast.unparse(child.test).endswith("TYPE_CHECKING")
            yield from statements(child, inside or isinstance(child, ast.FunctionDef), typed or of_types)
        elif isinstance(child, ast.ExceptHandler | ast.match_case):
            yield from statements(child, inside, typed)


def imports(tree, known, *, functions=True, annotations=False):
    for node, inside, typed in statements(tree):
        if (inside and not functions) or (typed and not annotations):
            continue
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "imports are absolute"
            source = node.module.split(".")
            if source[0] == "hovercontrol":
                for alias in node.names:
                    whole = ".".join([*source[1:], alias.name])
                    yield whole if whole in known else ".".join(source[1:])
        else:
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


def room(module):
    return module.partition(".")[0]


def circle(graph):
    """Return a circle in a graph, or nothing."""
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return error.args[1]
    return []


def test_there_are_nine_rooms():
    assert {path.name for path in ROOT.iterdir() if (path / "__init__.py").exists()} - {"analyses"} == set(
        ROOMS
    )
    assert {room(name) for name in modules()} == set(ROOMS)


def test_no_module_imports_from_a_room_above_its_own():
    assert sorted((a, b) for a, b in arrows() if HEIGHT[room(b)] > HEIGHT[room(a)]) == []


def test_no_module_names_a_type_of_a_room_above_its_own():
    trees = modules()
    arrows = {(a, b) for a, tree in trees.items() for b in imports(tree, trees, annotations=True) if b}
    against = {a for a, b in arrows if HEIGHT[room(b)] > HEIGHT[room(a)]}
    assert against <= {BLOCK}  # what a backend makes


def test_modules_import_each_other_in_no_circle():
    graph = defaultdict(set)
    for a, b in arrows():
        graph[a].add(b)
    assert circle(graph) == []


def test_each_room_says_in_ten_lines_what_is_in_it():
    for name in ROOMS:
        text = ast.get_docstring(modules()[name])
        assert text and len(text.splitlines()) <= 10, name
        assert "egin with" in text, name
