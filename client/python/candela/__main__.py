"""python3 -m candela ARGUMENTS is the command `candela ARGUMENTS` that this package calls."""
import os
import sys

from .errors import CandelaError
from .program import find_program


def main() -> None:
    try:
        program = find_program("candela")
    except CandelaError as error:
        sys.exit(f"candela: error: {error}")
    os.execv(program, ["candela", *sys.argv[1:]])


main()
