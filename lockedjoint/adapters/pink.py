"""For pink: see `formulations.adapters.pink`."""

from formulations.adapters.pink import WorstCaseBarrier as WorstCaseBarrier
from formulations.adapters.pink import WorstCaseTask as WorstCaseTask
