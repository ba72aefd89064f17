"""Translate a pFUnit test file (.pf) into Fortran code that uses the module `funit`.

    python translate_pf.py tests/unit/test_errors.pf build/tests/test_errors.F90

Only the part of the pFUnit language that the tests need is accepted. Everything else is refused,
even if pFUnit would accept or silently ignore it, so that every accepted file has the same result
under pFUnit. Each line is translated into one line of Fortran, so that compiler messages refer to
lines of the .pf file.
"""

import re
import sys
from pathlib import Path
from typing import NamedTuple


class Refused(Exception):
    """Error for a line outside the supported part of the language."""


class Suite(NamedTuple):
    """Procedures of a test file that the driver calls."""

    tests: list[str]
    fixtures: dict[str, str]


ORDER = "pf_unordered(real(e_, pf_real), real(a_, pf_real), e_ {} a_)"
# Condition under which an assertion fails; `a_` is the actual value and `e_` the expected one.
COMPARISON = {
    "equal": "pf_unequal(e_, a_)",
    "equal within": "pf_apart(e_, a_, {tolerance})",
    "lessthan": ORDER.format("<"),
    "lessthanorequal": ORDER.format("<="),
    "greaterthan": ORDER.format(">"),
    "greaterthanorequal": ORDER.format(">="),
}
CONDITION = {"true": "pf_holds({})", "false": "pf_holds(.not. ({}))"}
SUBROUTINE = re.compile(r"\s*subroutine\s+(\w+)\s*(?:\(\s*\))?\s*(?:!.*)?$", re.IGNORECASE)


def without_strings(line: str) -> str:
    """Return a line of code without its comment, and with strings replaced by blanks."""
    blanked = re.sub(r"'[^']*'|\"[^\"]*\"", lambda text: " " * len(text[0]), line)
    return blanked.split("!")[0]


def split_arguments(text: str) -> list[str]:
    """Return the arguments of a call, split at commas outside brackets and strings."""
    code = re.sub(r"'[^']*'|\"[^\"]*\"", lambda quoted: " " * len(quoted[0]), text)
    cuts, depth = [-1], 0
    for place, letter in enumerate(code):
        depth += (letter in "([") - (letter in ")]")
        if depth < 0:
            raise Refused("text after the closing bracket; nothing may follow a directive")
        if letter == "," and depth == 0:
            cuts.append(place)
    if depth > 0:
        raise Refused("unbalanced brackets; a directive stands on one line")
    ends = [*cuts[1:], len(text)]
    return [text[cut + 1 : end].strip() for cut, end in zip(cuts, ends, strict=True)]


def sort_arguments(text: str) -> tuple[list[str], dict[str, str]]:
    """Return the positional arguments, and the keywords `message` and `tolerance`."""
    positional: list[str] = []
    keywords: dict[str, str] = {}
    for argument in split_arguments(text):
        keyword = re.match(r"(\w+)\s*=(?!=)\s*(.+)", argument)
        if not keyword:
            if keywords:
                raise Refused("a positional argument after a keyword")
            positional.append(argument)
        elif keyword[1].lower() not in ("message", "tolerance") or keyword[1].lower() in keywords:
            raise Refused(f"keyword '{keyword[1]}'; once each: message=, tolerance=")
        else:
            keywords[keyword[1].lower()] = keyword[2]
    if "" in positional:
        raise Refused("an empty argument")
    return positional, keywords


def assertion(name: str, arguments: str, place: str) -> str:
    """Return the Fortran code of one `@assert`; `place` is file and line for messages."""
    values, keywords = sort_arguments(arguments)
    message = f", message={keywords['message']}" if "message" in keywords else ""
    kind = name.lower() + (" within" if "tolerance" in keywords else "")
    if kind in COMPARISON:
        expect_count(values, 2)
        # Double brackets, because gfortran 14 reports a wrong size for a string in single ones.
        check = (
            f"associate (e_ => (({values[0]})), a_ => (({values[1]}))); "
            "if (.not. pf_conform(shape(e_), shape(a_))) then; "
            f"call pf_fail({place}, 'Assert{name} failed: the shapes differ'{message}); "
            f"else; call pf_check({place}, 'Assert{name}', "
            f"[{COMPARISON[kind].format(**keywords)}]{message}); end if; end associate"
        )
    elif kind in CONDITION:
        expect_count(values, 1)
        condition = CONDITION[kind].format(values[0])
        check = f"if (.not. {condition}) call pf_fail({place}, 'Assert{name} failed'{message})"
    else:
        raise Refused(f"@assert{name} with these keywords is not in the common language")
    return f"{check}; if (anyexceptions()) return"


def expect_count(values: list[str], count: int) -> None:
    """Raise an error if the number of positional arguments is wrong.

    Tolerance and message must be keyword arguments.
    """
    if len(values) != count:
        raise Refused(f"{len(values)} positional arguments instead of {count}")


def translate_line(line: str, place: str) -> str:
    """Translate one line of a .pf file into one line of Fortran."""
    found = re.match(r"\s*@assert(\w+)\s*\((.*)\)\s*$", line, re.IGNORECASE)
    if found:
        return assertion(found[1], found[2], place)
    if re.match(r"\s*@(test|before|after)\s*$", line, re.IGNORECASE):
        return ""
    if "@" in without_strings(line):
        raise Refused("not a directive of the common language (alone on its line, no continuation)")
    return line


def find_suite(lines: list[str], stem: str) -> Suite:
    """Return the tests and fixtures of a file, whose module must be named like the file."""
    modules = [found[1] for line in lines if (found := re.match(r"\s*module\s+(\w+)\s*$", line))]
    if modules != [stem]:
        raise Refused(f"the file must hold one module, named {stem}")
    suite = Suite([], {})
    for number, line in enumerate(lines):
        found = re.match(r"\s*@(test|before|after)\s*$", line, re.IGNORECASE)
        if not found:
            continue
        kind = found[1].lower()
        following = lines[number + 1 :]
        if kind == "test":
            following = [text for text in following if without_strings(text).strip()]
        head = SUBROUTINE.match(following[0]) if following else None
        if not head:
            raise Refused(f"line {number + 1}: @{kind} needs a plain 'subroutine name()' next")
        if kind == "test":
            suite.tests.append(head[1])
        elif kind in suite.fixtures:
            raise Refused(f"line {number + 1}: a second @{kind}")
        else:
            suite.fixtures[kind] = head[1]
    return suite


def translate(source: Path) -> str:
    """Return the translated module of a file, with the subroutine that runs its tests."""
    lines = source.read_text().splitlines()
    suite = find_suite(lines, source.stem)
    fortran = [f'# 1 "{source}"']
    for number, line in enumerate(lines, start=1):
        try:
            fortran.append(translate_line(line, f"'{source.name}', {number}"))
        except Refused as refusal:
            raise Refused(f"line {number}: {refusal}") from None
    fixtures = "".join(f", {kind}={name}" for kind, name in suite.fixtures.items())
    fortran += [
        f"subroutine {source.stem}_suite()",
        "  use funit, only: pf_run",
        f"  use {source.stem}",
        "  implicit none",
        *(f"  call pf_run('{source.stem}.{test}', {test}{fixtures})" for test in suite.tests),
        f"end subroutine {source.stem}_suite",
    ]
    return "\n".join(fortran) + "\n"


def main() -> int:
    """Translate the file named on the command line; return 1 if it is refused."""
    source, target = map(Path, sys.argv[1:])
    try:
        target.write_text(translate(source))
    except Refused as refusal:
        print(f"{source}: {refusal}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
