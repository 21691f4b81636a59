"""The formulations from common starts, for eight joints: its table and its page."""

from results.comparison.comparison import study
from results.script import main

STUDY = study(8, __file__)

if __name__ == "__main__":
    main(STUDY, __file__)
