"""`python -m autodrive`: the command line, with the interpreter and the options that the user chooses."""

from autodrive.cli import main

__all__: list[str] = []

if __name__ == "__main__":
    main()
