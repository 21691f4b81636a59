"""``python -m lockedjoint`` is the command ``lockedjoint``."""

from formulations.__main__ import main

if __name__ == "__main__":
    main()
