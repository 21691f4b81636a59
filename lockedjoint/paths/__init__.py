"""The path of a tool: which joints may lock along it, and the trajectory for which most may."""
