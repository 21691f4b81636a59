"""The formulations from common starts, for eight joints: its table and its page.

`results.comparison.comparison` has what is computed, and says what goes out.
"""

from results.comparison.comparison import study
from results.script import main

STUDY = study(8, __file__)

if __name__ == "__main__":
    main(STUDY, __file__)
