"""For mink: see `formulations.adapters.mink`."""

from formulations.adapters.mink import MinkWorstCaseTask as MinkWorstCaseTask
