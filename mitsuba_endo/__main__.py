"""``python -m mitsuba_endo`` is the command ``mitsuba-endo``."""

from .cli.entry import main

if __name__ == "__main__":
    main()
