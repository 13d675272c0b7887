#!/usr/bin/env python3
"""Fills figures of JSON files (of `doppel evaluate`, `track` and `adapt`) into the text on standard input.

  scripts/tables.py FOLDER [SEED ...] <TEXT

{FILE KEY ... DIGITS} in the text becomes a number of FILE in FOLDER with DIGITS decimals. Each KEY is looked for below
the one before it, and the nearest one is taken; figures of single cameras and frames are left out. A list counts its
items. In FILE, @ stands for each seed: the text gets the mean and the largest distance from it, or the number alone if
there is one seed. [a,b] in FILE stands for a and b: the text gets their mean. A figure that a file does not have stays
empty.
"""
import itertools
import json
import re
import shlex
import sys
from pathlib import Path

DETAILS = ("cameras", "per_frame")  # keys below which each camera or frame has the same keys again


def below(node):
    """The objects in `node`, itself first, the nearest before those deeper."""
    level = [node]
    while level:
        yield from (child for child in level if isinstance(child, dict))
        level = [child for parent in level if isinstance(parent, (dict, list))
                 for key, child in (parent.items() if isinstance(parent, dict) else enumerate(parent))
                 if key not in DETAILS]


def find(node, keys):
    """The number at the keys, or None."""
    if not keys:
        if isinstance(node, list):
            return len(node)
        return node if isinstance(node, (int, float)) else None
    found = (find(child[keys[0]], keys[1:]) for child in below(node) if keys[0] in child)
    return next((number for number in found if number is not None), None)


def mean(numbers):
    return None if None in numbers else sum(numbers) / len(numbers)


def with_spread(numbers, digits):
    average = mean(numbers)
    if average is None:
        return ""
    spread = max(abs(number - average) for number in numbers)
    return f"{average:.{digits}f}" + (f" ± {spread:.{digits}f}" if len(numbers) > 1 else "")


def files_of(name):
    """The names that a name with [a,b] stands for."""
    parts = [part.split(",") if i % 2 else [part] for i, part in enumerate(re.split(r"\[([^]]*)\]", name))]
    return ["".join(choice) for choice in itertools.product(*parts)]


def fill(match, folder, seeds):
    name, *keys, digits = shlex.split(match.group(1))
    runs = [name.replace("@", seed) for seed in seeds] if "@" in name else [name]
    numbers = [mean([find(json.loads((folder / file).read_text()), keys) for file in files_of(run)]) for run in runs]
    return with_spread(numbers, int(digits))


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder, seeds = Path(sys.argv[1]), sys.argv[2:]
    text = sys.stdin.read()
    try:
        print(re.sub(r"\{([^{}]+)\}", lambda match: fill(match, folder, seeds), text), end="")
    except (OSError, ValueError) as error:
        sys.exit(f"tables.py: {error}")
