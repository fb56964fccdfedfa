"""``python -m mrdamper``: the command line."""

from mrdamper.cli import main

if __name__ == "__main__":
    main()
