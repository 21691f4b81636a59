"""From a statement to judged answers: setup → starts → records → outcome."""
