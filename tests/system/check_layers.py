#!/usr/bin/env python3
"""Check the structure of the Fortran sources: layers, names, privacy, output and size.

usage: check_layers.py [src]

A layer uses only itself and the layers to its right:
main > sweep > io > measure > steady > integrate > model > base. `external` uses base only and is
open to every layer except base; `spurflex.f90`, the front door, may use all of them.
"""

import re
import sys
from pathlib import Path

LAYERS = ["base", "model", "integrate", "steady", "measure", "io", "sweep", "main"]
FRONT_DOOR = "spurflex"

# Modules from outside the project, and the layers that may use them.
FOREIGN = {
    "mpi_f08": {"main", "sweep", "io"},
    "hdf5": {"io"},
    "h5ds": {"io"},
    "h5lt": {"io"},
}
INTRINSIC = {
    "iso_c_binding",
    "iso_fortran_env",
    "ieee_arithmetic",
    "ieee_exceptions",
    "ieee_features",
}

MOST_LINES = 400

USE = re.compile(r"^use\b\s*(?:,\s*(?:non_)?intrinsic\s*)?(?:::)?\s*(\w+)", re.IGNORECASE)
MODULE = re.compile(r"^module\s+(?!procedure\b|subroutine\b|function\b)(\w+)\s*$", re.IGNORECASE)
PROGRAM = re.compile(r"^program\s+(\w+)\s*$", re.IGNORECASE)
PRIVATE = re.compile(r"^private\s*$", re.IGNORECASE)
IMPLICIT_NONE = re.compile(r"^implicit\s+none\s*$", re.IGNORECASE)
OUTPUT = re.compile(
    r"^(?:if\s*\(.*\)\s*)?(?:print\s*[*'\"(]|print\s+\w|"
    r"write\s*\(\s*(?:unit\s*=\s*)?(?:\*|output_unit|error_unit)\s*[,)])",
    re.IGNORECASE,
)
STOP = re.compile(r"^(?:if\s*\(.*\)\s*)?(?:error\s+)?stop\b(?!\s*=|\s*\()", re.IGNORECASE)
OPEN = re.compile(r"^(?:if\s*\(.*\)\s*)?open\s*\(", re.IGNORECASE)


def statements(text):
    """Yield (line number, statement) without comments, continuations and indentation."""
    pending, first = "", 0
    for number, line in enumerate(text.splitlines(), start=1):
        code = strip_comment(line).strip()
        if not code:
            continue
        if pending:
            code = pending + code.removeprefix("&").lstrip()
        else:
            first = number
        if code.endswith("&"):
            pending = code[:-1].rstrip() + " "
            continue
        pending = ""
        yield first, code


def strip_comment(line):
    """A line up to the exclamation mark that is not in a string."""
    quote = ""
    for position, character in enumerate(line):
        if quote:
            quote = "" if character == quote else quote
        elif character in "'\"":
            quote = character
        elif character == "!":
            return line[:position]
    return line


def layer_of(relative):
    """Layer of a source file, from its path below src."""
    if len(relative.parts) > 1:
        return relative.parts[0]
    return relative.name.split(".")[0]


def module_name(relative):
    """Name that the module in a source file must have."""
    stem = relative.name.split(".")[0]
    if relative.parts == (relative.name,) and stem == FRONT_DOOR:
        return FRONT_DOOR
    return "_".join(["spurflex", *relative.parts[:-1], stem])


def may_use(layer, used):
    """Whether a file of one layer may use a module of another."""
    if layer in (used, FRONT_DOOR):
        return True
    if layer == "external":
        return used == "base"
    if used == "external":
        return layer != "base"
    if used == FRONT_DOOR:
        return layer == "main"
    if layer not in LAYERS or used not in LAYERS:
        return False
    return LAYERS.index(used) < LAYERS.index(layer)


def use_fault(layer, name, owner):
    """What is wrong with one `use`, None if nothing is."""
    if name in owner:
        if not may_use(layer, owner[name]):
            return f"layer '{layer}' must not use '{name}' of layer '{owner[name]}'"
    elif name in FOREIGN:
        if layer not in FOREIGN[name]:
            return f"layer '{layer}' must not use '{name}'"
    elif name not in INTRINSIC:
        return f"unknown module '{name}'"
    return None


def check_file(path, relative, owner):
    """Faults of one source file, as (line, text)."""
    text = path.read_text(encoding="utf-8")
    layer = layer_of(relative)
    is_program = relative == Path("main.f90")
    may_print = is_program or (layer == "io" and relative.parts[1].startswith("log"))
    if layer not in {*LAYERS, "external", FRONT_DOOR}:
        yield 1, f"'{layer}' is no layer"

    modules, seen_private, seen_implicit = [], False, False
    for line, code in statements(text):
        if match := MODULE.match(code):
            modules.append(match[1].lower())
        elif match := USE.match(code):
            if fault := use_fault(layer, match[1].lower(), owner):
                yield line, fault
        elif PRIVATE.match(code):
            seen_private = True
        elif IMPLICIT_NONE.match(code):
            seen_implicit = True
        if OUTPUT.match(code) and not may_print:
            yield line, "only main.f90 and io/log write to the terminal"
        if STOP.match(code) and not is_program:
            yield line, "only main.f90 stops"
        if OPEN.match(code) and layer not in {"io", "external"}:
            yield line, "only io and external open files"

    if not seen_implicit:
        yield 1, "no 'implicit none'"
    if not is_program:
        expected = module_name(relative)
        if modules != [expected]:
            yield 1, f"must hold one module, '{expected}'; holds {modules or 'none'}"
        if not seen_private:
            yield 1, "no 'private'"
    lines = text.count("\n")
    if lines > MOST_LINES:
        yield 1, f"{lines} lines; at most {MOST_LINES}"


def check_tree(source):
    """Faults of every source file below a folder, as printable lines."""
    files = sorted([*source.rglob("*.f90"), *source.rglob("*.f90.in")])
    if not files:
        return [f"{source}: no Fortran source"]
    owner = {module_name(path.relative_to(source)): layer_of(path.relative_to(source)) for path in files}
    faults = []
    for path in files:
        relative = path.relative_to(source)
        faults += [f"{path}:{line}: {fault}" for line, fault in check_file(path, relative, owner)]
    return faults


def main():
    source = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).resolve().parents[2] / "src"
    faults = check_tree(source)
    print("\n".join(faults) if faults else f"{source}: layers, names and sizes are in order")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
