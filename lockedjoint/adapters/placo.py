"""For placo: see `formulations.adapters.placo`."""

from formulations.adapters.placo import WorstCaseConstraint as WorstCaseConstraint
