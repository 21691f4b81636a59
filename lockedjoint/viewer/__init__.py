"""A robot, its sliders and its locks in a web page."""
